// Every member of a flight throwing, ending early, and standing still, under a simulated clock: what is said,
// when, what recovers, and what becomes of health, the run and arming.

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "tests/firmware_host/supervisor/simulated_flight.hpp"

namespace swiftlet {
namespace {

using test::kMembers;
using test::kSaidWithin;
using test::SimulatedFlight;

constexpr double kTurn = 0.11;  // s: one look, and the simulation's own step

bool isFlight(const char* name) { return memberRule(name).kind == MemberKind::kFlight; }

TEST_CASE("a flight in order is good and ready to arm", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(2.0);
  CHECK(flight.verdict.health == Health::kGood);
  CHECK_FALSE(flight.verdict.arming.ready());  // health has not been good for long enough
  flight.pass(8.0);
  CHECK(flight.verdict.arming.ready());
  CHECK(flight.verdict.troubles.empty());
  CHECK_FALSE(flight.verdict.run_failed);
  CHECK(flight.times("ready to arm") == 1);
  CHECK(flight.told.back().text == "ready to arm");
  CHECK(flight.supervisor.json()["arming"]["first_ready_ns"].get<std::int64_t>() > flight.start.ns);
}

TEST_CASE("a member that throws is lost at once and stays lost", "[supervisor]") {
  for (const char* name : kMembers) {
    INFO(name);
    SimulatedFlight flight;
    flight.pass(8.0);
    REQUIRE(flight.verdict.arming.ready());
    flight.heart(name).fail("no memory", flight.now);
    const Stamp threw = flight.now;
    flight.stall(name);
    CHECK(flight.until([&] { return flight.trouble(name, Cause::kThrew) != nullptr; }) < kTurn);
    CHECK(flight.times(std::string(name) + " is lost: no memory") == 1);
    CHECK(flight.trouble(name, Cause::kThrew)->since == threw);
    CHECK(flight.verdict.health == (isFlight(name) ? Health::kFailed : Health::kDegraded));
    CHECK(flight.verdict.run_failed == isFlight(name));
    CHECK(flight.supervisor.runFailed() == isFlight(name));
    CHECK(flight.verdict.arming.lacks(ArmingCondition::kMembers));
    flight.pass(20.0);
    CHECK(flight.trouble(name, Cause::kThrew) != nullptr);
    CHECK(flight.verdict.run_failed == isFlight(name));
    CHECK(flight.times(std::string(name) + " is lost") == 1);
  }
}

TEST_CASE("a member that ends early is lost; at the end of a run it is not", "[supervisor]") {
  for (const char* name : kMembers) {
    INFO(name);
    SimulatedFlight early;
    early.pass(8.0);
    early.heart(name).end(early.now);
    early.stall(name);
    CHECK(early.until([&] { return early.trouble(name, Cause::kEndedEarly) != nullptr; }) < kTurn);
    CHECK(early.verdict.run_failed == isFlight(name));
    CHECK(early.verdict.health == (isFlight(name) ? Health::kFailed : Health::kDegraded));

    SimulatedFlight in_order;
    in_order.pass(8.0);
    in_order.supervisor.expectEnd();
    in_order.heart(name).end(in_order.now);
    in_order.stall(name);
    in_order.pass(20.0);
    CHECK(in_order.verdict.troubles.empty());
    CHECK_FALSE(in_order.verdict.run_failed);
  }
}

TEST_CASE("a stall of 2 s degrades and recovers", "[supervisor]") {
  for (const char* name : kMembers) {
    INFO(name);
    SimulatedFlight flight;
    flight.pass(8.0);
    flight.stall(name);
    const double silence = memberRule(name).late.seconds();
    const double said = flight.until([&] { return flight.trouble(name, Cause::kNoTurn) != nullptr; });
    CHECK(said > silence - kTurn);
    CHECK(said < silence + kSaidWithin);
    CHECK(flight.times(std::string(name) + " is late: no progress for") == 1);
    CHECK(flight.verdict.health == Health::kDegraded);
    const bool side = memberRule(name).kind == MemberKind::kSide;
    CHECK(flight.verdict.arming.lacks(ArmingCondition::kMembers) == !side);
    flight.pass(2.0 - said);
    flight.resume(name);
    CHECK(flight.until([&] { return flight.verdict.troubles.empty(); }) < kTurn);
    CHECK(flight.times(std::string(name) + " has recovered after 2.") == 1);
    CHECK(flight.verdict.health == Health::kGood);
    CHECK_FALSE(flight.verdict.run_failed);
    CHECK(flight.verdict.arming.ready());
  }
}

TEST_CASE("a stall for good is a loss", "[supervisor]") {
  for (const char* name : kMembers) {
    INFO(name);
    SimulatedFlight flight;
    flight.pass(8.0);
    flight.stall(name);
    flight.heart(name).doing("sort");
    const auto lost = [&] {
      const Trouble* trouble = flight.trouble(name, Cause::kNoTurn);
      return trouble != nullptr && trouble->condition == Condition::kLost;
    };
    const double limit = memberRule(name).lost.seconds();
    const double said = flight.until(lost);
    CHECK(said > limit - kTurn);
    CHECK(said < limit + kSaidWithin);
    CHECK(flight.times(std::string(name) + " is lost: no progress for") == 1);
    CHECK(std::string(flight.trouble(name, Cause::kNoTurn)->text.data()).find("last seen at: sort") !=
          std::string::npos);
    CHECK(flight.verdict.run_failed == isFlight(name));
    CHECK(flight.verdict.health == (isFlight(name) ? Health::kFailed : Health::kDegraded));
    CHECK(flight.verdict.arming.lacks(ArmingCondition::kMembers));
    // A flight thread that comes back comes too late: the run ends. Others are welcome.
    flight.resume(name);
    flight.pass(1.0);
    CHECK(flight.verdict.troubles.empty());
    CHECK(flight.verdict.run_failed == isFlight(name));
    CHECK(flight.verdict.health == (isFlight(name) ? Health::kFailed : Health::kGood));
  }
}

TEST_CASE("a thread that never begins is told", "[supervisor]") {
  Supervisor supervisor;
  Heartbeat heart;
  REQUIRE(supervisor.add("smooth", heart));
  supervisor.begin({}, nullptr);
  for (int i = 0; i <= 5; ++i) supervisor.step(Stamp{1'000'000'000} + Duration::fromMilliseconds(100 * i));
  const Verdict verdict = supervisor.verdict();
  bool found = false;
  for (const Trouble& trouble : verdict.troubles) {
    found = found || (trouble.cause == Cause::kNoTurn &&
                      std::string(trouble.text.data()).find("not started") != std::string::npos);
  }
  CHECK(found);
}

TEST_CASE("what goes bad four times stays degraded", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  for (int time = 1; time <= 4; ++time) {
    INFO(time);
    flight.stall("mesh");
    flight.pass(2.0);
    flight.resume("mesh");
    flight.pass(5.0);
    CHECK(flight.verdict.health == (time < 4 ? Health::kGood : Health::kDegraded));
  }
  REQUIRE(flight.trouble("mesh", Cause::kFlapping) != nullptr);
  CHECK(flight.times("mesh is unsteady: failed 4 times") == 1);
  CHECK_FALSE(flight.verdict.arming.ready());
  flight.pass(10.0);
  CHECK(flight.verdict.health == Health::kDegraded);
}

TEST_CASE("a break of the supervisor itself accuses nobody", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  // The process was stopped for 20 s; the supervisor is the first to run again.
  flight.now = flight.now + Duration::fromMilliseconds(20'000);
  flight.supervisor.step(flight.now);
  CHECK(flight.verdict.troubles.empty());
  CHECK_FALSE(flight.verdict.run_failed);
  flight.stall("smooth");
  CHECK(flight.until([&] { return flight.trouble("smooth", Cause::kNoTurn) != nullptr; }) <
        0.3 + kSaidWithin);
}

TEST_CASE("a changed figure is no news, a changed list is", "[supervisor]") {
  SimulatedFlight flight;
  flight.pass(8.0);
  const std::uint32_t before = flight.verdict.trouble_changes;
  flight.stall("loop");
  flight.pass(5.0);
  CHECK(flight.verdict.trouble_changes == before + 1);
  flight.stall("map");
  flight.pass(6.0);
  CHECK(flight.verdict.trouble_changes == before + 3);  // map late, and loop lost
  CHECK(flight.verdict.worst()->name() == std::string("loop"));
}

TEST_CASE("events of a log's run carry the log's clock", "[supervisor]") {
  SimulatedFlight flight(false);
  flight.pass(3.0);
  flight.stall("mesh");
  flight.pass(0.05);
  const std::int64_t log_now = flight.facts.imu.newest.ns;
  std::int64_t stamp = 0;
  while (stamp == 0) {
    flight.now = flight.now + Duration::fromMilliseconds(100);
    for (const char* name : kMembers) {
      if (std::string(name) != "mesh") flight.heart(name).beat(flight.now);
    }
    flight.supervisor.step(flight.now);
    flight.supervisor.drainEvents([&](Stamp at, const std::string& text) {
      if (text.find("mesh is late") != std::string::npos) stamp = at.ns;
    });
  }
  CHECK(stamp > log_now);
  CHECK(stamp < log_now + 2'000'000'000);
}

TEST_CASE("the thread looks by itself and ends when told", "[supervisor]") {
  Supervisor supervisor;
  Heartbeat heart;
  REQUIRE(supervisor.add("smooth", heart));
  std::atomic<int> verdicts{0};
  REQUIRE(supervisor.addSink([&](const Verdict&) { ++verdicts; }));
  supervisor.begin({}, [](FlightFacts&) {});
  ThreadSettings settings;
  settings.name = "supervisor";
  REQUIRE(supervisor.start(settings).started);
  heart.begin();
  heart.fail("gone");
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!supervisor.runFailed() && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(supervisor.runFailed());
  supervisor.stop();
  CHECK(verdicts > 0);
  CHECK(supervisor.verdict().run_failed);
}

}  // namespace
}  // namespace swiftlet
