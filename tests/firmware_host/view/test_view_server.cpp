// The live view's server, seen from plain sockets: quick ones, slow ones, and such as want no good.

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/view/view_server.hpp"
#include "firmware_host/outputs/view/view_thread.hpp"
#include "firmware_host/outputs/view/view_token.hpp"
#include "firmware_host/realtime/stage_timer.hpp"
#include "tests/support/view_client.hpp"

namespace swiftlet {
namespace {

using std::chrono::milliseconds;

ViewHub::Text event(const std::string& name, const std::string& data) {
  return std::make_shared<const std::string>("event: " + name + "\ndata: " + data + "\n\n");
}

struct Served {
  ViewHub hub;
  std::unique_ptr<ViewServer> server;

  explicit Served(const std::string& host = "127.0.0.1") {
    ViewAddress address;
    address.host = host;
    address.port = 0;
    const ViewPages pages{[] { return std::string("<p>page</p>"); }, [] { return std::string("figures\n"); }};
    server = std::make_unique<ViewServer>(hub, address, pages);
  }
  [[nodiscard]] int port() const { return server->address().port; }
  [[nodiscard]] std::string get(const std::string& path,
                                const std::string& headers = "Host: 127.0.0.1\r\n") const {
    ViewClient client(port());
    REQUIRE(client.connectAndAsk(path, headers));
    return client.readAll();
  }
  void waitForViewers(std::size_t count) const {
    for (int i = 0; i < 300 && hub.viewers() < count; ++i) std::this_thread::sleep_for(milliseconds(10));
    REQUIRE(hub.viewers() == count);
  }
  /// Seconds until the server has ended.
  double end() {
    const double begin = wallSeconds();
    server.reset();
    return wallSeconds() - begin;
  }
};

TEST_CASE("the page, the figures, and nothing else") {
  Served served;
  CHECK(served.port() > 0);
  CHECK(served.get("/").find("<p>page</p>") != std::string::npos);
  CHECK(served.get("/").starts_with("HTTP/1.1 200"));
  CHECK(served.get("/text").find("\r\n\r\nfigures\n") != std::string::npos);
  CHECK(served.get("/other").starts_with("HTTP/1.1 404"));
  CHECK(served.get("/../etc/passwd").starts_with("HTTP/1.1 404"));
  CHECK(served.get("/", "Host: evil.example\r\n").starts_with("HTTP/1.1 403"));
  CHECK(served.get("/stream", "Host: 127.0.0.1\r\nOrigin: http://evil.example\r\n")
            .starts_with("HTTP/1.1 403"));
  ViewClient post(served.port());
  REQUIRE(post.connect());
  REQUIRE(post.send("POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 3\r\n\r\nabc"));
  CHECK(post.readAll().starts_with("HTTP/1.1 405"));
}

TEST_CASE("beyond loopback nothing is served without the token") {
  unsetenv(kViewTokenVariable);
  Served served("0.0.0.0");
  const std::string url = served.server->url();
  const std::size_t at = url.find("/?token=");
  REQUIRE(at != std::string::npos);
  const std::string token = url.substr(at + 8);
  CHECK(token.size() == 32);
  std::string wrong = token;
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  for (const char* name : {"/", "/text", "/stream", "/other"}) {
    const std::string path = name;
    CAPTURE(path);
    CHECK(served.get(path).starts_with("HTTP/1.1 403"));
    CHECK(served.get(path + "?token=").starts_with("HTTP/1.1 403"));
    CHECK(served.get(path + "?token=" + wrong).starts_with("HTTP/1.1 403"));
    CHECK(served.get(path + "?token=" + token + "0").starts_with("HTTP/1.1 403"));
  }
  CHECK(served.hub.counters().viewers == 0);
  CHECK(served.get("/?token=" + token).find("<p>page</p>") != std::string::npos);
  CHECK(served.get("/text?token=" + token).find("figures") != std::string::npos);
  ViewClient viewer(served.port());
  REQUIRE(viewer.connectAndAsk("/stream?token=" + token));
  served.waitForViewers(1);
  // Another server has another.
  CHECK(Served("0.0.0.0").server->url().find(token) == std::string::npos);
}

TEST_CASE("a service has a token of its own, if it is a usable one") {
  setenv(kViewTokenVariable, "my-own_token-0123", 1);
  CHECK(Served("0.0.0.0").server->url().ends_with("/?token=my-own_token-0123"));
  CHECK(Served().server->url().ends_with("/"));
  for (const char* unusable : {"", "short", "has a space in it", "has&an=ampersand"}) {
    setenv(kViewTokenVariable, unusable, 1);
    CAPTURE(unusable);
    CHECK_THROWS_AS(Served("0.0.0.0"), InputError);
  }
  unsetenv(kViewTokenVariable);
}

TEST_CASE("tokens are the same only as a whole") {
  CHECK(sameToken("abcd", "abcd"));
  for (const char* other : {"", "abc", "abcde", "abcdabcd", "xbcd", "abcx"})
    CHECK_FALSE(sameToken("abcd", other));
}

TEST_CASE("moments of a run that is over are asked for by number") {
  ViewHub hub;
  ViewAddress address;
  address.port = 0;
  ViewPages pages{[] { return std::string("page"); }, [] { return std::string("text"); }};
  pages.moment = [](std::size_t i) {
    return i < 3 ? "{\"frame\":" + std::to_string(i) + "}" : std::string();
  };
  const ViewServer server(hub, address, pages);
  const auto get = [&](const std::string& path, const std::string& headers = "Host: 127.0.0.1\r\n") {
    ViewClient client(server.address().port);
    REQUIRE(client.connectAndAsk(path, headers));
    return client.readAll();
  };
  const std::string answer = get("/moment?i=2");
  CHECK(answer.starts_with("HTTP/1.1 200"));
  CHECK(answer.find("application/json") != std::string::npos);
  CHECK(answer.find("\r\n\r\n{\"frame\":2}") != std::string::npos);
  for (const char* path : {"/moment?i=3", "/moment?i=-1", "/moment?i=1x", "/moment?i=99999999999999999999999",
                           "/moment?i=", "/moment", "/moment/1"}) {
    INFO(path);
    CHECK(get(path).starts_with("HTTP/1.1 404"));
  }
  CHECK(get("/moment?i=1", "Host: evil.example\r\n").starts_with("HTTP/1.1 403"));
  // A live view has none.
  CHECK(Served().get("/moment?i=1").starts_with("HTTP/1.1 404"));
}

TEST_CASE("requests that are too long or none at all end without an answer, and the server goes on") {
  Served served;
  for (const std::string& text : {std::string("GET /") + std::string(4000, 'a') + " HTTP/1.1\r\n\r\n",
                                  "GET / HTTP/1.1\r\nX: " + std::string(40000, 'a') + "\r\n\r\n",
                                  std::string("\r\n\r\n"), std::string("\0\1\2\r\n\r\n", 7)}) {
    ViewClient client(served.port());
    REQUIRE(client.connect());
    static_cast<void>(client.send(text));
    const std::string answer = client.readAll();
    CHECK(answer.find(" 200 ") == std::string::npos);
  }
  // A header that is nobody's business, of a length that a careless reader chokes on.
  CHECK(served.get("/", "Host: 127.0.0.1\r\nRange: bytes=" + std::string(9000, '1') + "-\r\n")
            .starts_with("HTTP/1.1 200"));
}

TEST_CASE("a viewer gets the document, the patches in order and the end") {
  Served served;
  ViewClient client(served.port());
  REQUIRE(client.connectAndAsk("/stream"));
  served.waitForViewers(1);
  served.hub.offer(event("document", "{}"));
  for (int i = 0; i < 20; ++i) served.hub.publish(event("patch", std::to_string(i)));
  std::thread reading([&] { client.readAll(); });
  CHECK(served.end() < 3);
  reading.join();
  const std::string& text = client.text();
  CHECK(text.find("text/event-stream") != std::string::npos);
  std::size_t at = text.find("event: document\ndata: {}\n\n");
  for (int i = 0; i < 20; ++i) {
    const std::size_t next = text.find("event: patch\ndata: " + std::to_string(i) + "\n\n", at);
    REQUIRE(next != std::string::npos);
    CHECK(next > at);
    at = next;
  }
  CHECK(text.find("event: end", at) != std::string::npos);
  CHECK(served.hub.counters().delivered == 20);
}

TEST_CASE("slow viewers hold back nobody, lose patches and do not delay the end") {
  Served served;
  std::vector<ViewClient> slow;
  for (int i = 0; i < 3; ++i) slow.emplace_back(served.port(), true);
  for (ViewClient& one : slow) REQUIRE(one.connectAndAsk("/stream"));
  ViewClient quick(served.port());
  REQUIRE(quick.connectAndAsk("/stream"));
  served.waitForViewers(4);
  served.hub.offer(event("document", "{}"));
  std::atomic<bool> stop{false};
  std::thread dripping([&] {
    while (!stop && slow[0].readSome(0, 1)) std::this_thread::sleep_for(milliseconds(1000));
  });
  std::thread reading([&] { quick.readAll(); });
  constexpr int kPatches = 200;
  const std::string filling(40000, 'x');
  for (int i = 0; i < kPatches; ++i) {
    const double begin = wallSeconds();
    served.hub.publish(event("patch", std::to_string(i) + " " + filling));
    // Who publishes waits for nobody; the machine may be busy.
    CHECK(wallSeconds() - begin < 1);
    std::this_thread::sleep_for(milliseconds(5));
  }
  // The quick one has had everything before the end is told.
  for (int i = 0; i < 500 && served.hub.counters().delivered < kPatches; ++i) {
    std::this_thread::sleep_for(milliseconds(10));
  }
  const ViewHub::Counters counters = served.hub.counters();
  const double took = served.end();
  stop = true;
  reading.join();
  dripping.join();
  CHECK(took < 3);
  CHECK(counters.dropped > kPatches);  // of three viewers
  for (int i = 0; i < kPatches; ++i) {
    CHECK(quick.text().find("data: " + std::to_string(i) + " x") != std::string::npos);
  }
  CHECK(quick.text().find("event: end") != std::string::npos);
}

TEST_CASE("sockets that ask for nothing do not delay the end") {
  Served served;
  std::vector<ViewClient> silent;
  for (int i = 0; i < 24; ++i) silent.emplace_back(served.port());
  for (ViewClient& one : silent) REQUIRE(one.connect());
  REQUIRE(silent[0].send("GET / HT"));
  std::this_thread::sleep_for(milliseconds(100));
  CHECK(served.end() < 3);
}

TEST_CASE("one viewer more than there are places is refused, others are answered") {
  Served served;
  std::vector<ViewClient> viewers;
  for (std::size_t i = 0; i < ViewHub::kMostViewers; ++i) viewers.emplace_back(served.port());
  for (ViewClient& one : viewers) REQUIRE(one.connectAndAsk("/stream"));
  served.waitForViewers(ViewHub::kMostViewers);
  CHECK(served.get("/stream").starts_with("HTTP/1.1 503"));
  CHECK(served.get("/").starts_with("HTTP/1.1 200"));
  CHECK(served.hub.counters().refused == 1);
  // Who goes is noticed with the next patch, and makes room.
  viewers.pop_back();
  served.hub.offer(event("document", "{}"));
  for (int i = 0; i < 100 && served.hub.viewers() == ViewHub::kMostViewers; ++i) {
    served.hub.publish(event("patch", std::string(1000, 'x')));
    std::this_thread::sleep_for(milliseconds(10));
  }
  ViewClient another(served.port());
  REQUIRE(another.connectAndAsk("/stream"));
  served.waitForViewers(ViewHub::kMostViewers);
}

TEST_CASE("a port that is taken is said before anything runs, with the option and a remedy") {
  Served served;
  ViewHub hub;
  ViewAddress address;
  address.port = served.port();
  const auto again = [&] { ViewServer(hub, address, {}); };
  // No InputError, by which the program would end with exit code 2 and the service would not try again.
  CHECK_THROWS_AS(again(), std::runtime_error);
  try {
    again();
  } catch (const std::exception& error) {
    CHECK(std::string(error.what())
              .find("--view: " + address.text() +
                    ": another program serves there already. Choose another with --view") == 0);
  }
}

TEST_CASE("a broken pipe ends no program that serves") {
  std::signal(SIGPIPE, SIG_DFL);
  { const Served served; }
  CHECK(std::signal(SIGPIPE, SIG_DFL) == SIG_IGN);
}

TEST_CASE("a run is followed from an outlet to a viewer") {
  const auto outlet = std::make_unique<LiveOutlet>();
  ViewAddress address;
  address.port = 0;
  ViewThread view(*outlet, address, "a run", Rig{});
  CHECK(view.url().starts_with("http://127.0.0.1:"));
  const int port = std::stoi(view.url().substr(view.url().rfind(':') + 1));
  ViewClient client(port);
  REQUIRE(client.connectAndAsk("/stream"));
  FrameNews frame;
  frame.has_state = true;
  frame.health = Health::kGood;
  const auto patches = [&client] {
    const std::string text = client.text();
    std::size_t count = 0;
    for (std::size_t at = 0; (at = text.find("event: patch", at)) != std::string::npos; ++at) ++count;
    return count;
  };
  // As long as it takes, on a machine that is slow.
  for (int i = 0; i < 600 && patches() < 2; ++i) {
    frame.stamp.ns += 50'000'000;
    outlet->frame.write(frame);
    client.readSome(0.05);
  }
  const double begin = wallSeconds();
  const nlohmann::ordered_json counted = view.finish();
  CHECK(wallSeconds() - begin < 3);
  client.readAll();
  CHECK(client.text().find("event: document") != std::string::npos);
  CHECK(client.text().find("event: patch") != std::string::npos);
  CHECK(client.text().find("\"name\":\"a run\"") != std::string::npos);
  CHECK(client.text().ends_with("event: end\ndata: {}\n\n"));
  CHECK(counted["viewers"] == 1);
  CHECK(counted["delivered"] >= 3);
  CHECK(counted["dropped"] == 0);
}

}  // namespace
}  // namespace swiftlet
