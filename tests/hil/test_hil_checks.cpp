#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "firmware_host/lab/hil/hil_checks.hpp"
#include "tests/firmware_host/xml_reader.hpp"

namespace swiftlet {
namespace {

constexpr std::int64_t kStart = 5'000'000'000;
constexpr double kFlight = 10;  // s

// Each name tells the quantity and its limit.
const std::string kTold = "reported with a remedy within 3 s of its end: ";
const std::string kLowered = "health not good from 0.5 s after its start to its end: ";
const std::string kReturned = "no longer reported as faulty 3 s after its last fault: ";
const std::string kRecovered = "health good within 3 s of the last fault's end";
const std::string kPlayed = "log played to its end, no image late";
const std::string kEnded = "flight ended as requested";
const std::string kBlind = "health failed from 3.4 s without a usable image";
const std::string kPoses = "good frames: motion wrong by at most 0.06 m over 1 s, 0.03 m between images";

Stamp inFlight(double seconds) { return Stamp{kStart} + Duration::fromSeconds(seconds); }

SE3 poseAt(double t) { return SE3(Eigen::Quaterniond::Identity(), {std::sin(t), std::cos(t), 0.1 * t}); }

/// A flight that followed the truth, good but from `low_begin` to `low_end`.
HilEvidence flight(const std::string& faults, double low_begin = 0, double low_end = 0) {
  HilEvidence evidence;
  evidence.faults = FaultTimeline::parse("faults", faults);
  evidence.first_image = inFlight(0);
  evidence.last_image = inFlight(kFlight);
  evidence.complete = true;
  evidence.finished = true;
  for (int i = 0; i <= 2000; ++i) evidence.truth.push_back({inFlight(i * 0.005), poseAt(i * 0.005)});
  for (int i = 0; i <= 200; ++i) {
    const double t = i * 0.05;
    const bool low = t >= low_begin && t < low_end;
    evidence.frames.push_back({inFlight(t), poseAt(t), low ? Health::kDegraded : Health::kGood, 0});
  }
  return evidence;
}

const HilCheck* find(const HilVerdict& verdict, const std::string& name) {
  const auto& checks = verdict.checks();
  const auto found =
      std::ranges::find_if(checks, [&](const HilCheck& check) { return check.name.starts_with(name); });
  return found == checks.end() ? nullptr : &*found;
}

bool fails(const HilEvidence& evidence, const std::string& name) {
  const HilVerdict verdict = checkHil(evidence);
  INFO(verdict.text());
  const HilCheck* check = find(verdict, name);
  REQUIRE(check != nullptr);
  return !check->passed && !verdict.passed();
}

const HilEvidence::Line kSilent{inFlight(5),
                                "IMU (/run/imu, bridge): sends nothing (1.0 s); check its power"};
const HilEvidence::Line kBack{inFlight(6.01), "IMU (/run/imu, bridge): works again"};

HilEvidence stalled() {
  HilEvidence evidence = flight("4,imu,stall,2\n", 4, 6.6);
  evidence.remarks = {kSilent, kBack};
  return evidence;
}

TEST_CASE("A flight that did what it must passes every check", "[hil]") {
  const HilVerdict verdict = checkHil(stalled());
  INFO(verdict.text());
  CHECK(verdict.passed());
  for (const std::string& name : {kPlayed, kEnded, kTold + "imu stall", kLowered + "imu stall",
                                  kReturned + "imu", kRecovered, kPoses}) {
    INFO(name);
    CHECK(find(verdict, name) != nullptr);
  }
}

TEST_CASE("Each check fails on what it is for", "[hil]") {
  SECTION("not played") {
    HilEvidence evidence = stalled();
    evidence.complete = false;
    CHECK(fails(evidence, kPlayed));
  }
  SECTION("not ended") {
    HilEvidence evidence = stalled();
    evidence.finished = false;
    CHECK(fails(evidence, kEnded));
  }
  SECTION("a fault that nobody tells of") {
    HilEvidence evidence = stalled();
    evidence.remarks = {kBack};
    CHECK(fails(evidence, kTold + "imu stall"));
  }
  SECTION("a line without a remedy") {
    HilEvidence evidence = stalled();
    evidence.remarks[0].text = "IMU (/run/imu, bridge): sends nothing";
    CHECK(fails(evidence, kTold + "imu stall"));
  }
  SECTION("another device's line") {
    HilEvidence evidence = stalled();
    evidence.remarks[0].text = "camera 0 (/dev/video0): sends nothing; check its power";
    CHECK(fails(evidence, kTold + "imu stall"));
  }
  SECTION("a device that stays away") {
    HilEvidence evidence = stalled();
    evidence.remarks = {kSilent};
    CHECK(fails(evidence, kReturned + "imu"));
  }
  SECTION("a defect that stays") {
    HilEvidence evidence = stalled();
    evidence.remarks.push_back({inFlight(7), "IMU (/run/imu, bridge): loses data (100 of 200); check"});
    CHECK(fails(evidence, kReturned + "imu"));
    evidence.remarks.push_back({inFlight(8), "IMU (/run/imu, bridge): normal again"});
    CHECK(checkHil(evidence).passed());
  }
  SECTION("good without an IMU") {
    HilEvidence evidence = stalled();
    evidence.frames[100].health = Health::kGood;
    CHECK(fails(evidence, kLowered + "imu stall"));
  }
  SECTION("good at IMU rate without an IMU") {
    HilEvidence evidence = stalled();
    evidence.states = {{inFlight(5), poseAt(5), Health::kGood, 0}};
    CHECK(fails(evidence, kLowered + "imu stall"));
  }
  SECTION("never good again") {
    HilEvidence evidence = flight("4,imu,stall,2\n", 4, 11);
    evidence.remarks = {kSilent, kBack};
    CHECK(fails(evidence, kRecovered));
  }
  SECTION("a jump that is called good") {
    HilEvidence evidence = stalled();
    for (std::size_t i = 160; i < evidence.frames.size(); ++i) {
      evidence.frames[i].T_world_body.translation.x() += 0.04;
    }
    CHECK(fails(evidence, kPoses));
    // Another epoch has another origin.
    for (std::size_t i = 160; i < evidence.frames.size(); ++i) evidence.frames[i].epoch = 1;
    CHECK(checkHil(evidence).passed());
  }
  SECTION("a slow drift that is called good") {
    HilEvidence evidence = stalled();
    for (std::size_t i = 0; i < evidence.frames.size(); ++i) {
      evidence.frames[i].T_world_body.translation.z() += 0.07 * 0.05 * static_cast<double>(i);
    }
    CHECK(fails(evidence, kPoses));
  }
  SECTION("nothing good at all") { CHECK(fails(flight("", 0, 11), kPoses)); }
  SECTION("blind and not failed") {
    HilEvidence evidence = flight("2,camera0,dark,5\n2.1,camera1,stall,5\n", 2, 7.6);
    CHECK(fails(evidence, kBlind));
    for (HilEvidence::Judged& pose : evidence.frames) {
      if (pose.stamp > inFlight(5.1) && pose.stamp < inFlight(7.1)) pose.health = Health::kFailed;
    }
    CHECK(find(checkHil(evidence), kBlind) == nullptr);
  }
}

TEST_CASE("What a device cannot show need not be told", "[hil]") {
  const auto told = [](const std::string& faults) {
    return find(checkHil(flight(faults, 0, 11)), kTold) != nullptr;
  };
  CHECK(told("4,camera0,stall,1.5\n"));
  CHECK_FALSE(told("4,camera0,stall,1.2\n"));
  CHECK_FALSE(told("4,camera0,dark,2,40\n"));
  CHECK_FALSE(told("4,imu,drop,2.5,0.1\n"));
  CHECK(told("4,imu,clock_step,0,-0.25\n"));
  // Too near the end of the flight.
  CHECK_FALSE(told("9,imu,clock_step,0,-0.25\n"));
  const FaultTimeline both = FaultTimeline::parse("faults", "4,camera0,dark,3\n5,camera0,stall,1.5\n");
  const FaultStretch dark = longestVisible(both.faults()[0], both);
  CHECK(dark.begin == Duration::fromSeconds(4));
  CHECK(dark.end == Duration::fromSeconds(5));
  const FaultStretch stall = longestVisible(both.faults()[1], both);
  CHECK(stall.length() == Duration::fromSeconds(1.5));
}

TEST_CASE("Faults of one kind that run into each other are told once", "[hil]") {
  HilEvidence evidence = flight("3,imu,unplug,1.5\n4,imu,unplug,2\n", 3, 6.6);
  evidence.remarks = {{inFlight(3.01), "IMU (/run/imu, bridge): gone; connect it again"}, kBack};
  CHECK_FALSE(fails(evidence, kTold + "imu unplug at 4.000 s"));
  // With a pause between them the second is another.
  evidence.faults = FaultTimeline::parse("faults", "3,imu,unplug,0.5\n4,imu,unplug,2\n");
  CHECK(fails(evidence, kTold + "imu unplug at 4.000 s"));
}

TEST_CASE("The checks as JUnit are XML that says what failed", "[hil]") {
  HilEvidence evidence = stalled();
  evidence.remarks = {kBack};
  const XmlElement root = XmlReader::read(checkHil(evidence).junit("a \"flight\" & more"));
  const XmlElement& suite = *root.all("testsuite").at(0);
  CHECK(suite.attributes.at("name") == "a \"flight\" & more");
  CHECK(suite.attributes.at("failures") == "1");
  CHECK(std::to_string(suite.all("testcase").size()) == suite.attributes.at("tests"));
  REQUIRE(suite.all("failure").size() == 1);
  CHECK(suite.all("failure")[0]->attributes.at("message").find("events.log") != std::string::npos);
}

}  // namespace
}  // namespace swiftlet
