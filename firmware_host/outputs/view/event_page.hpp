#pragma once
// A page of one's own on the live view's server: a document of HTML, and a stream of JSON for it
// (docs/view.md): each event is the whole state, so that a viewer who lost some needs nothing else.
//
// publish() from one thread; it waits for nobody. Memory and viewers as ViewHub's.

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

class EventPage {
 public:
  /// Listens from now on. InputError naming --view where the address cannot be had.
  EventPage(const ViewAddress& address, std::string html);
  ~EventPage();
  EventPage(const EventPage&) = delete;
  EventPage& operator=(const EventPage&) = delete;

  [[nodiscard]] std::string url() const;
  /// Whether somebody looks.
  [[nodiscard]] bool watched() const;
  /// `text`: the same for GET /text.
  void publish(const nlohmann::ordered_json& state, const std::string& text);

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
