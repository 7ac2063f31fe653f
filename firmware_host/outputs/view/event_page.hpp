#pragma once
// An independent page on the live view's server: an HTML document and a stream of JSON events for it
// (docs/view.md). Each event is the whole state, so a viewer that lost some needs nothing else.
//
// publish() from one thread; it does not wait. Memory and viewers as in ViewHub.

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

class EventPage {
 public:
  /// Starts listening. InputError naming --view if the address is not available.
  EventPage(const ViewAddress& address, std::string html);
  ~EventPage();
  EventPage(const EventPage&) = delete;
  EventPage& operator=(const EventPage&) = delete;

  [[nodiscard]] std::string url() const;
  /// Whether there are viewers.
  [[nodiscard]] bool watched() const;
  /// `text`: the same state for GET /text.
  void publish(const nlohmann::ordered_json& state, const std::string& text);

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
