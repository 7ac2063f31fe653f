// What systemd hears, on a socket of the test's own.

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "firmware_host/supervisor/systemd_notify.hpp"
#include "tests/firmware_host/supervisor/simulated_flight.hpp"

namespace swiftlet {
namespace {

using test::kMembers;
using test::SimulatedFlight;

/// A socket in the abstract name space, and the environment that names it.
class Listener {
 public:
  explicit Listener(const char* watchdog_usec, const std::string& pid = std::to_string(::getpid()))
      : name_("@swiftlet-test-" + std::to_string(::getpid())) {
    sockaddr_un address = {};
    address.sun_family = AF_UNIX;
    std::copy(name_.begin(), name_.end(), address.sun_path);
    address.sun_path[0] = '\0';
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    REQUIRE(::bind(socket_, reinterpret_cast<const sockaddr*>(&address),
                   static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name_.size())) == 0);
    ::setenv("NOTIFY_SOCKET", name_.c_str(), 1);
    if (watchdog_usec != nullptr) ::setenv("WATCHDOG_USEC", watchdog_usec, 1);
    ::setenv("WATCHDOG_PID", pid.c_str(), 1);
  }
  ~Listener() {
    ::close(socket_);
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) ::unsetenv(name);
  }
  std::vector<std::string> hear() const {
    std::vector<std::string> heard;
    char bytes[2000];
    for (ssize_t got = 0; (got = ::recv(socket_, bytes, sizeof bytes, 0)) > 0;) {
      heard.emplace_back(bytes, static_cast<std::size_t>(got));
    }
    return heard;
  }

 private:
  std::string name_;
  int socket_ = -1;
};

/// The kernel keeps ten datagrams for a reader: it reads as time goes on.
std::vector<std::string> heardIn(SimulatedFlight& flight, const Listener& listener, double seconds) {
  std::vector<std::string> all;
  for (double passed = 0; passed < seconds; passed += 0.5) {
    flight.pass(0.5);
    const std::vector<std::string> some = listener.hear();
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

/// The watchdog of systemd's side, as src/core/service.c has it: WATCHDOG=1 and WATCHDOG_USEC arm it in every
/// state, STOPPING=1 disarms it only where systemd has not asked for the stop itself.
class Watchdog {
 public:
  explicit Watchdog(const Listener& listener) : listener_(listener) {}

  void follow(SimulatedFlight& flight, double seconds) {
    for (const Stamp end = flight.now + Duration::fromSeconds(seconds); flight.now < end;) {
      flight.pass(0.1);
      hear(flight.now);
    }
  }
  void hear(Stamp now) {
    killed = killed || (ends && now > *ends);
    for (const std::string& message : listener_.hear()) {
      std::istringstream lines(message);
      for (std::string line; std::getline(lines, line);) take(line, now);
    }
  }

  /// `systemctl stop`.
  void requestStop() {
    running_ = false;
    ends.reset();
  }

  bool killed = false;
  std::optional<Stamp> ends;  ///< when it kills the process; empty: it is disarmed

 private:
  void take(const std::string& line, Stamp now) {
    if (line == "STOPPING=1" && running_) requestStop();
    const std::string limit = "WATCHDOG_USEC=";
    if (line.starts_with(limit)) limit_ = Duration{std::stoll(line.substr(limit.size())) * 1000};
    if (line.starts_with(limit) || line == "READY=1" || line == "WATCHDOG=1") {
      ends = limit_.ns > 0 ? std::optional(now + limit_) : std::nullopt;
    }
  }

  const Listener& listener_;
  Duration limit_ = Duration::fromMilliseconds(2000);
  bool running_ = true;
};

int count(const std::vector<std::string>& heard, const std::string& what) {
  return static_cast<int>(std::count(heard.begin(), heard.end(), what));
}

TEST_CASE("without systemd nothing is sent", "[systemd]") {
  ::unsetenv("NOTIFY_SOCKET");
  SystemdNotify notify;
  CHECK_FALSE(notify.wanted());
  CHECK(notify.ready());
  notify.status("nobody listens");
  notify.watchdog(Stamp{1});
}

TEST_CASE("messages are those of sd_notify", "[systemd]") {
  const Listener listener("2000000");
  SystemdNotify notify;
  CHECK(notify.ready());
  notify.status("good");
  notify.status("good");
  notify.status("degraded");
  CHECK(notify.stopping());
  CHECK(listener.hear() ==
        std::vector<std::string>{"READY=1", "STATUS=good", "STATUS=degraded", "STOPPING=1\nWATCHDOG_USEC=0"});
}

TEST_CASE("the watchdog is fed four times in its limit", "[systemd]") {
  const Listener listener("2000000");
  SystemdNotify notify;
  for (const int ms : {0, 499, 500}) notify.watchdog(Stamp{} + Duration::fromMilliseconds(ms));
  CHECK(listener.hear() == std::vector<std::string>{"WATCHDOG=1", "WATCHDOG=1"});
}

TEST_CASE("the watchdog of another process is not ours", "[systemd]") {
  const Listener listener("2000000", "1");
  SystemdNotify notify;
  CHECK(notify.wanted());
  notify.watchdog(Stamp{1});
  CHECK(listener.hear().empty());
}

TEST_CASE("a listener that reads nothing blocks nobody", "[systemd]") {
  const Listener listener("2000000");
  SystemdNotify notify;
  std::size_t taken = 0;
  for (int i = 0; i < 10'000; ++i) taken += notify.ready() ? 1 : 0;
  CHECK(listener.hear().size() == taken);
  CHECK(taken < 10'000);
}

TEST_CASE("systemd hears of the start once it listens", "[systemd]") {
  const Listener listener("2000000");
  SystemdNotify notify;
  while (notify.ready()) {
  }
  SimulatedFlight flight(true, 1, &notify);
  flight.pass(1.0);
  const std::size_t stuck = listener.hear().size();
  CHECK(count(heardIn(flight, listener, 3.0), "READY=1") == 1);
  CHECK(stuck > 0);
}

TEST_CASE("the watchdog is fed until a flight thread stands for good", "[systemd]") {
  for (const char* name : kMembers) {
    INFO(name);
    const Listener listener("2000000");
    SystemdNotify notify;
    SimulatedFlight flight(true, 1, &notify);
    std::vector<std::string> heard = heardIn(flight, listener, 10.0);
    CHECK(count(heard, "READY=1") == 1);
    CHECK(heard.front() == "READY=1");
    const int fed = count(heard, "WATCHDOG=1");
    CHECK(fed >= 19);
    CHECK(fed <= 21);
    CHECK(count(heard, "STATUS=good, ready to arm") == 1);
    // As long as the stall may pass it is fed: systemd's 2 s would end what is to recover after 2 s.
    flight.stall(name);
    CHECK(count(heardIn(flight, listener, 2.0), "WATCHDOG=1") >= 3);
    heard = heardIn(flight, listener, 10.0);
    if (memberRule(name).kind != MemberKind::kFlight) {
      CHECK(count(heard, "WATCHDOG=1") >= 19);
      CHECK(count(heard, "STATUS=degraded, not ready to arm; " + std::string(name) + " lost") == 1);
      continue;
    }
    CHECK(count(heard, "STATUS=failed, not ready to arm; " + std::string(name) + " lost") == 1);
    CHECK(count(heard, "WATCHDOG_USEC=30000000") == 1);
    // STOPPING would disarm the watchdog.
    flight.supervisor.expectEnd();
    CHECK(heardIn(flight, listener, 10.0).empty());
  }
}

TEST_CASE("a failed run has time to write its files, and is killed if it hangs", "[systemd]") {
  const Listener listener("2000000");
  SystemdNotify notify;
  SimulatedFlight flight(true, 1, &notify);
  Watchdog watchdog(listener);
  watchdog.follow(flight, 10.0);
  flight.stall("smooth");
  while (!flight.verdict.run_failed) watchdog.follow(flight, 0.1);
  flight.supervisor.expectEnd();
  // The stuck thread has 2 s, stuck followers have 2 s; then the supervisor ends and files are written.
  watchdog.follow(flight, 4.0);
  flight.supervisor.stop();
  watchdog.hear(flight.now);
  CHECK_FALSE(watchdog.killed);
  REQUIRE(watchdog.ends);
  CHECK((*watchdog.ends - flight.now).seconds() > 20);
  CHECK((*watchdog.ends - flight.now).seconds() < 30);
}

TEST_CASE("the watchdog does not end a run that ends in order while files are written", "[systemd]") {
  const bool by_systemd = GENERATE(false, true);
  const double last_look = GENERATE(0.0, 1.0);  // s after the end began
  CAPTURE(by_systemd, last_look);
  const Listener listener("2000000");
  SystemdNotify notify;
  SimulatedFlight flight(true, 1, &notify);
  Watchdog watchdog(listener);
  watchdog.follow(flight, 10.0);
  if (by_systemd) watchdog.requestStop();
  watchdog.follow(flight, 0.6);  // the watchdog is fed before the program notices the request
  flight.supervisor.expectEnd();
  watchdog.follow(flight, last_look);
  flight.supervisor.stop();
  watchdog.hear(flight.now);
  CHECK_FALSE(watchdog.killed);
  CHECK_FALSE(watchdog.ends);
}

TEST_CASE("a watchdog that is off stays off when a run fails", "[systemd]") {
  const Listener listener(nullptr);
  SystemdNotify notify;
  SimulatedFlight flight(true, 1, &notify);
  heardIn(flight, listener, 5.0);
  flight.heart("smooth").fail("no memory", flight.now);
  const std::vector<std::string> heard = heardIn(flight, listener, 1.0);
  CHECK(count(heard, "STATUS=failed, not ready to arm; smooth lost") == 1);
  CHECK(heard.size() == 1);
}

TEST_CASE("the end is told once, whether or not the supervisor looks again", "[systemd]") {
  for (const bool looks : {true, false}) {
    INFO("looks " << looks);
    const Listener listener(nullptr);
    SystemdNotify notify;
    SimulatedFlight flight(true, 1, &notify);
    heardIn(flight, listener, 5.0);
    flight.supervisor.expectEnd();
    if (looks) {
      const std::vector<std::string> heard = heardIn(flight, listener, 5.0);
      CHECK(count(heard, "STOPPING=1") == 1);
      CHECK(count(heard, "WATCHDOG=1") == 0);
    }
    flight.supervisor.stop();
    CHECK(listener.hear() == (looks ? std::vector<std::string>{} : std::vector<std::string>{"STOPPING=1"}));
  }
}

}  // namespace
}  // namespace swiftlet
