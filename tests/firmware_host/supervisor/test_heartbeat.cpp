// The sign of life, read while its thread lives and dies.

#include <catch2/catch.hpp>
#include <stdexcept>
#include <string>
#include <thread>

#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {
namespace {

TEST_CASE("a heartbeat says what its thread did", "[heartbeat]") {
  Heartbeat heart;
  CHECK(heart.read().life == Life::kNotBegun);
  heart.begin(Stamp{10});
  heart.doing("wait");
  heart.beat(Stamp{20});
  heart.beat(Stamp{30});
  Beat beat = heart.read();
  CHECK(beat.life == Life::kRunning);
  CHECK(beat.last == Stamp{30});
  CHECK(beat.turns == 2);
  CHECK(beat.doing == std::string("wait"));
  heart.fail(std::string(500, 'x'), Stamp{40});
  heart.end(Stamp{50});
  heart.fail("later", Stamp{60});
  beat = heart.read();
  CHECK(beat.life == Life::kFailed);
  CHECK(beat.last == Stamp{40});
  CHECK(beat.fault == std::string(Heartbeat::kFaultBytes, 'x'));
}

TEST_CASE("an entry's exception becomes the heartbeat's fault and goes on", "[heartbeat]") {
  Heartbeat good, bad;
  runBeating(good, [&] { good.beat(); });
  CHECK(good.read().life == Life::kEnded);
  CHECK_THROWS(runBeating(bad, [] { throw std::runtime_error("broken"); }));
  CHECK(bad.read().life == Life::kFailed);
  CHECK(bad.read().fault == "broken");
}

TEST_CASE("a heartbeat is read while it is written", "[heartbeat][stress]") {
  for (int life = 0; life < 50; ++life) {
    Heartbeat heart;
    std::thread thread([&] {
      heart.begin();
      for (int i = 0; i < 1000; ++i) heart.beat();
      heart.fail("the text of the failure");
    });
    Beat beat;
    std::uint64_t turns = 0;
    do {
      beat = heart.read();
      REQUIRE(beat.turns >= turns);
      turns = beat.turns;
      if (beat.life == Life::kNotBegun) std::this_thread::yield();
    } while (beat.life != Life::kFailed);
    CHECK(beat.fault == "the text of the failure");
    CHECK(beat.turns == 1000);
    thread.join();
  }
}

}  // namespace
}  // namespace swiftlet
