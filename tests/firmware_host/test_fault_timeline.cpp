// The timeline of faults: the same file gives the same faults, a wrong one says where it is wrong.

#include <array>
#include <catch2/catch.hpp>

#include "firmware_host/lab/hil/fault_timeline.hpp"
#include "tests/support/input_error.hpp"

namespace swiftlet {
namespace {

std::string complaint(std::string_view text) {
  return test::messageOf([&] { (void)FaultTimeline::parse("faults.csv", text); });
}

constexpr Duration at(double seconds) { return Duration::fromSeconds(seconds); }

TEST_CASE("lines are read in any order, with comments, spaces and line ends of any kind") {
  const FaultTimeline timeline = FaultTimeline::parse("faults.csv",
                                                      "# a flight\n"
                                                      "\n"
                                                      "8,camera1, dark ,2,40\r\n"
                                                      " 5.5 , imu,stall,0.5 # and so on\n"
                                                      "5.5,trigger,drop,1\n"
                                                      "6,imu,drop,1");
  REQUIRE(timeline.faults().size() == 4);
  CHECK(timeline.text() ==
        "5.500,imu,stall,0.500,0\n"
        "5.500,trigger,drop,1.000,0.5\n"
        "6.000,imu,drop,1.000,0.5\n"
        "8.000,camera1,dark,2.000,40\n");
  CHECK(FaultTimeline::parse("again", timeline.text()).text() == timeline.text());
  CHECK(timeline.active(FaultDevice::kImu, PlannedFaultKind::kStall, at(5.4999)) == nullptr);
  CHECK(timeline.active(FaultDevice::kImu, PlannedFaultKind::kStall, at(5.5)) == timeline.faults().data());
  CHECK(timeline.active(FaultDevice::kImu, PlannedFaultKind::kStall, at(6)) == nullptr);
  CHECK(timeline.active(FaultDevice::kCamera0, PlannedFaultKind::kDark, at(9)) == nullptr);
  REQUIRE(timeline.active(FaultDevice::kCamera1, PlannedFaultKind::kDark, at(9)) != nullptr);
  CHECK(timeline.active(FaultDevice::kCamera1, PlannedFaultKind::kDark, at(9))->value == 40);
  CHECK(FaultTimeline::parse("none", "").faults().empty());
}

TEST_CASE("a wrong line is refused with its number, its field and what may stand there") {
  CHECK_THAT(complaint("1,imu,stall,1\n\n2,imu,stall"),
             Catch::Contains("faults.csv") && Catch::Contains("3") && Catch::Contains("3 fields"));
  CHECK_THAT(complaint("1,imu,stall,1,2,3"), Catch::Contains("6 fields"));
  CHECK_THAT(complaint("-1,imu,stall,1"), Catch::Contains("seconds") && Catch::Contains("`-1`"));
  CHECK_THAT(complaint("nan,imu,stall,1"), Catch::Contains("seconds"));
  CHECK_THAT(complaint("1e300,imu,stall,1"), Catch::Contains("seconds"));
  CHECK_THAT(complaint("1,imo,stall,1"),
             Catch::Contains("device") && Catch::Contains("`imo`") && Catch::Contains("camera0, camera1"));
  CHECK_THAT(complaint("1,imu,dark,1"),
             Catch::Contains("fault") && Catch::Contains("unplug, stall, garbage"));
  CHECK_THAT(complaint("1,camera0,garbage,1"), Catch::Contains("dark, freeze"));
  CHECK_THAT(complaint("1,imu,stall,x"), Catch::Contains("for seconds") && Catch::Contains("`x`"));
  CHECK_THAT(complaint("1,imu,drop,1,1.5"), Catch::Contains("value") && Catch::Contains("from 0 to 1"));
  CHECK_THAT(complaint("1,camera0,dark,1,256"), Catch::Contains("value") && Catch::Contains("255"));
  CHECK_THROWS_WITH(FaultTimeline::read("no/such/file"), Catch::Contains("no/such/file"));
}

TEST_CASE("a timeline that nobody wrote by hand is refused") {
  std::string text;
  for (int i = 0; i < 20'000; ++i) text += "1,imu,clock_step,1,1000000\n";
  CHECK_THAT(complaint(text), Catch::Contains("faults"));
}

TEST_CASE("chance is of the line and the occasion alone, and has its share") {
  constexpr std::string_view kText =
      "1,imu,drop,9,0.25\n1,camera0,drop,9,0.25\n1,camera1,drop,9,0\n1,trigger,drop,9,1\n";
  const FaultTimeline timeline = FaultTimeline::parse("a", kText);
  const FaultTimeline again = FaultTimeline::parse("b", kText);
  std::array<int, 4> struck{};
  int together = 0;
  constexpr std::uint64_t kOccasions = 20'000;
  for (std::uint64_t n = 0; n < kOccasions; ++n) {
    for (std::size_t f = 0; f < 4; ++f) {
      const bool strikes = timeline.strikes(timeline.faults()[f], n);
      REQUIRE(strikes == again.strikes(again.faults()[f], n));
      struck.at(f) += strikes ? 1 : 0;
    }
    together +=
        timeline.strikes(timeline.faults()[0], n) && timeline.strikes(timeline.faults()[1], n) ? 1 : 0;
  }
  // Five standard deviations.
  CHECK(std::abs(struck[0] - 5000) < 310);
  CHECK(std::abs(struck[1] - 5000) < 310);
  CHECK(struck[2] == 0);
  CHECK(struck[3] == kOccasions);
  CHECK(std::abs(together - 1250) < 175);
}

TEST_CASE("steps of the clock add up and stay") {
  const FaultTimeline timeline = FaultTimeline::parse("a", "2,imu,clock_step,1\n3,imu,clock_step,1,-1.5\n");
  CHECK(timeline.clockStep(at(1.9)).ns == 0);
  CHECK(timeline.clockStep(at(2)) == at(0.25));
  CHECK(timeline.clockStep(at(100)) == at(-1.25));
}

}  // namespace
}  // namespace swiftlet
