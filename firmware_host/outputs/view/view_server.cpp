#include "firmware_host/outputs/view/view_server.hpp"

#include <fmt/format.h>
#include <httplib.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <charconv>
#include <limits>
#include <stdexcept>
#include <system_error>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/view/connection.hpp"
#include "firmware_host/outputs/view/low_threads.hpp"
#include "firmware_host/outputs/view/view_token.hpp"
#include "firmware_host/realtime/flight_thread.hpp"
#include "firmware_host/realtime/host_sleep.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {
namespace {

constexpr double kGrace = 0.5;        // s, for viewers to receive the end
constexpr double kLookForNews = 0.1;  // s
constexpr int kMostStart = 5000;      // ms
constexpr int kSendBuffer = 131072;   // bytes; more would only be old data by the time a slow viewer reads it
constexpr const char* kHtml = "text/html; charset=utf-8";

/// A connection as the library reads and writes it.
class Stream : public httplib::Stream {
 public:
  explicit Stream(Connection& connection) : connection_(connection) {}
  [[nodiscard]] bool is_readable() const override { return connection_.unread() > 0; }
  [[nodiscard]] bool is_writable() const override { return !connection_.failed(); }
  ssize_t read(char* to, std::size_t size) override {
    return static_cast<ssize_t>(connection_.read(to, size));
  }
  ssize_t write(const char* from, std::size_t size) override { return connection_.write(from, size); }
  // Not used by the answers.
  void get_remote_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  void get_local_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  [[nodiscard]] socket_t socket() const override { return connection_.socket(); }

 private:
  Connection& connection_;
};

class Tasks : public httplib::TaskQueue {
 public:
  void enqueue(std::function<void()> job) override { threads_.enqueue(std::move(job)); }
  void shutdown() override { threads_.shutdown(); }

 private:
  LowThreads threads_;
};

/// The connection being answered, for the one callback that does not receive it.
thread_local Connection* answering = nullptr;

}  // namespace

class ViewServer::Work : public httplib::Server {
 public:
  Work(ViewHub& hub, ViewAddress address, ViewPages pages)
      : hub_(hub), address_(std::move(address)), token_(viewToken(address_)), pages_(std::move(pages)) {
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      answer(request, response);
      return HandlerResponse::Handled;
    });
    set_socket_options([](socket_t socket) {
      const int on = 1;
      // Without SO_REUSEPORT, which would let two programs share the port.
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
      setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof(kSendBuffer));
    });
    set_tcp_nodelay(true);
    new_task_queue = [] { return new Tasks; };
    listen();
  }

  ~Work() override {
    hub_.end();
    deadline_.store(wallSeconds() + kGrace, std::memory_order_relaxed);
    stop();
    thread_.join();
  }
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  [[nodiscard]] const ViewAddress& address() const { return address_; }
  [[nodiscard]] std::string url() const {
    return "http://" + address_.text() + (token_.empty() ? "/" : "/?token=" + token_);
  }

 private:
  void listen() {
    errno = 0;
    if (address_.port == 0) {
      const int port = bind_to_any_port(address_.host);
      if (port <= 0) fail(errno);
      address_.port = port;
    } else if (!bind_to_port(address_.host, address_.port)) {
      fail(errno);
    }
    ThreadSettings settings;
    settings.name = "view_accept";
    settings.stack_bytes = LowThreads::stackBytes();
    const ThreadReport report = thread_.start(settings, [this] {
      yieldToOthers();
      static_cast<void>(listen_after_bind());
    });
    if (!report.started) throw InputError("--view", 0, address_.text(), report.message, "");
    // stop() has no effect before the server is running.
    for (int i = 0; i < kMostStart && !is_running(); ++i) sleepFor(Duration::fromMilliseconds(1));
  }

  [[noreturn]] void fail(int error) const {
    const bool taken = error == EADDRINUSE;
    std::string what = "cannot be served at: " + std::generic_category().message(error);
    if (taken) what = "another program serves there already";
    if (error == 0) what = "is no address of this host";
    const InputError said("--view", 0, address_.text(), what,
                          taken ? "Choose another with --view ADDRESS:PORT, or port 0 for any that is free"
                                : "Give --view an address of this host and a port that this user may have");
    // The address may come up with its network, and the port may be freed by another program: a service that
    // ends with this exception is restarted, one that ends with an InputError is not.
    throw std::runtime_error(said.what());
  }

  // Replaces the library's function, whose reads and writes have no overall deadline.
  bool process_and_close_socket(socket_t socket) override {
    Connection connection(socket, deadline_, kPatience);
    bool done = false;
    if (connection.readHead()) {
      bool closed = false;
      Stream stream(connection);
      answering = &connection;
      done = process_request(stream, true, closed, nullptr);
      answering = nullptr;
    }
    ::shutdown(socket, SHUT_RDWR);
    ::close(socket);
    return done;
  }

  void answer(const httplib::Request& request, httplib::Response& response) {
    response.set_header("Cache-Control", "no-store");
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("X-Frame-Options", "DENY");
    response.set_header("Referrer-Policy", "no-referrer");
    if (!viewMayAnswer(address_, request.get_header_value("Host"), request.get_header_value("Origin"))) {
      return say(response, 403, "ask for this host by its address, or from a page of this server\n");
    }
    if (request.method != "GET") return say(response, 405, "GET is all that there is\n");
    // Browsers request it without the page's query.
    if (request.path == "/favicon.ico") {
      response.status = 204;
      return;
    }
    if (!token_.empty() && !sameToken(token_, request.get_param_value("token"))) {
      return say(response, 403,
                 "the token is missing or wrong: use the address printed when the view began\n");
    }
    if (request.path == "/") {
      response.set_content(pages_.page(), kHtml);
    } else if (request.path == "/text") {
      response.set_content(pages_.text(), "text/plain; charset=utf-8");
    } else if (request.path == "/stream") {
      stream(response);
    } else if (request.path == "/moment") {
      moment(request.get_param_value("i"), response);
    } else {
      say(response, 404, "there is /, /stream and /text\n");
    }
  }

  void moment(const std::string& index, httplib::Response& response) {
    std::size_t i = 0;
    const char* end = index.data() + index.size();
    const auto [rest, error] = std::from_chars(index.data(), end, i);
    const bool good = pages_.moment && error == std::errc() && rest == end;
    const std::string json = good ? pages_.moment(i) : std::string();
    if (json.empty()) return say(response, 404, "there is no such moment\n");
    response.set_content(json, "application/json");
  }

  static void say(httplib::Response& response, int status, const char* text) {
    response.status = status;
    response.set_content(text, "text/plain; charset=utf-8");
  }

  void stream(httplib::Response& response) {
    const int place = hub_.admit();
    if (place < 0) {
      return say(response, 503, "all places of viewers are taken, or the run has ended\n");
    }
    Connection* connection = answering;
    response.set_content_provider(
        "text/event-stream",
        [this, place](std::size_t /*offset*/, httplib::DataSink& sink) { return follow(place, sink); },
        [this, place, connection](bool /*success*/) { hub_.leave(place, connection->gaveUp()); });
  }

  /// Sends until the viewer leaves or the run ends.
  bool follow(int place, httplib::DataSink& sink) {
    for (;;) {
      ViewHub::Text text;
      switch (hub_.next(place, kLookForNews, text)) {
        case ViewHub::Next::kMessage:
          if (!sink.write(text->data(), text->size())) return false;
          break;
        case ViewHub::Next::kNothing:
          break;
        case ViewHub::Next::kEnded: {
          const std::string end = "event: end\ndata: {}\n\n";
          const bool sent = sink.write(end.data(), end.size());
          sink.done();
          return sent;
        }
      }
    }
  }

  ViewHub& hub_;
  ViewAddress address_;
  const std::string token_;  ///< empty: not required
  ViewPages pages_;
  std::atomic<double> deadline_{std::numeric_limits<double>::infinity()};
  FlightThread thread_;
};

ViewServer::ViewServer(ViewHub& hub, const ViewAddress& address, ViewPages pages)
    : work_(std::make_unique<Work>(hub, address, std::move(pages))) {}
ViewServer::~ViewServer() = default;

const ViewAddress& ViewServer::address() const { return work_->address(); }
std::string ViewServer::url() const { return work_->url(); }

}  // namespace swiftlet
