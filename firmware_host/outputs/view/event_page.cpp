#include "firmware_host/outputs/view/event_page.hpp"

#include <mutex>
#include <nlohmann/json.hpp>
#include <utility>

#include "firmware_host/outputs/view/view_hub.hpp"
#include "firmware_host/outputs/view/view_server.hpp"

namespace swiftlet {

class EventPage::Work {
 public:
  Work(const ViewAddress& address, std::string html) : html_(std::move(html)) {
    ViewPages pages{[this] { return html_; },
                    [this] {
                      const std::lock_guard lock(mutex_);
                      return text_;
                    }};
    server_ = std::make_unique<ViewServer>(hub_, address, std::move(pages));
  }

  void publish(const nlohmann::ordered_json& state, const std::string& text) {
    const auto event = std::make_shared<const std::string>(
        "event: state\ndata: " +
        state.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n\n");
    hub_.publish(event);
    if (hub_.documentWanted()) hub_.offer(event);
    const std::lock_guard lock(mutex_);
    text_ = text;
  }
  [[nodiscard]] std::string url() const { return server_->url(); }
  [[nodiscard]] bool watched() const { return hub_.viewers() > 0; }

 private:
  ViewHub hub_;
  const std::string html_;
  std::mutex mutex_;
  std::string text_;
  std::unique_ptr<ViewServer> server_;
};

EventPage::EventPage(const ViewAddress& address, std::string html)
    : work_(std::make_unique<Work>(address, std::move(html))) {}
EventPage::~EventPage() = default;
std::string EventPage::url() const { return work_->url(); }
bool EventPage::watched() const { return work_->watched(); }
void EventPage::publish(const nlohmann::ordered_json& state, const std::string& text) {
  work_->publish(state, text);
}

}  // namespace swiftlet
