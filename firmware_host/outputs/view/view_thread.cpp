#include "firmware_host/outputs/view/view_thread.hpp"

#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/view/live_document.hpp"
#include "firmware_host/outputs/view/live_images.hpp"
#include "firmware_host/outputs/view/low_threads.hpp"
#include "firmware_host/outputs/view/view_budget.hpp"
#include "firmware_host/outputs/view/view_server.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {
namespace {

constexpr double kSamplePeriod = 0.05;  // s
constexpr int kSamplesPerPatch = 4;
constexpr double kDocumentPeriod = 0.25;  // s; documents are not made more often

std::string livePageText() {
  const ReportProgram program = readReportProgram();
  return program.name.empty() ? "" : livePage(program.text, program.name);
}

/// Used without the page's program: figures as text, reloaded every second.
std::string plainLivePage(const std::string& text) {
  return "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">"
         "<meta http-equiv=\"refresh\" content=\"1\"><title>swiftlet live</title></head>"
         "<body><h1>swiftlet live</h1><pre>" +
         htmlText(text) +
         "</pre><p>This installation has no page with plots (share/swiftlet/report_page.html): npm makes it "
         "when swiftlet is built.</p></body></html>";
}

/// A message of Server-Sent Events.
ViewHub::Text message(const char* event, const nlohmann::ordered_json& data) {
  std::string text = "event: ";
  text += event;
  text += "\ndata: ";
  text += data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  text += "\n\n";
  return std::make_shared<const std::string>(std::move(text));
}

}  // namespace

class ViewThread::Work final : public Follower::Work {
 public:
  Work(LiveOutlet& outlet, const ViewAddress& address, const std::string& name, const Rig& rig)
      : outlet_(outlet), images_(rig), document_(name, images_.cameras()), page_(livePageText()) {
    text_ = document_.text();
    const auto text = [this] {
      const std::lock_guard lock(mutex_);
      return text_;
    };
    ViewPages pages{[this, text] { return page_.empty() ? plainLivePage(text()) : page_; }, text};
    server_ = std::make_unique<ViewServer>(hub_, address, std::move(pages));
    address_ = server_->address();
    url_ = server_->url();
    ThreadSettings settings;
    settings.name = "view";
    thread_.start(settings, "--view", "", [this] { run(); });
  }

  bool end() override {
    if (!thread_.end()) return false;
    server_.reset();
    return true;
  }
  [[nodiscard]] const std::string& url() const { return url_; }
  [[nodiscard]] nlohmann::ordered_json json() const override {
    nlohmann::ordered_json json = {{"address", address_.text()}};
    json.update(toJson(hub_.counters()));
    return json;
  }

 private:
  void run() {
    yieldToOthers();
    int sample = 0;
    thread_.repeat(kSamplePeriod, [&](double now) {
      const bool watched = hub_.viewers() > 0;
      document_.sample(outlet_, now, watched);
      if (images_.sample(outlet_, now, watched)) publishImages(now);
      budget_.adapt(now, [this] { return hub_.imagesTaken(); });
      if (sample++ % kSamplesPerPatch == 0) publish(now);
    });
    document_.sample(outlet_, wallSeconds(), hub_.viewers() > 0);
    publish(wallSeconds());
  }

  void publishImages(double now) {
    if (!budget_.mayShow(now)) return images_.skip();
    const double t = document_.timeOf(images_.stamp());
    const ViewHub::Text images = message("images", images_.take(outlet_, t, budget_.pictures()));
    hub_.publishImages(images);
    budget_.spendOnImages(images->size());
  }

  void publish(double now) {
    document_.setViewers(toJson(hub_.counters()));
    // Made even without viewers, because patch() marks changes as sent.
    const ViewHub::Text patch = message("patch", document_.patch());
    hub_.publish(patch);
    budget_.spend(patch->size());
    if (hub_.documentWanted() && now - document_made_ >= kDocumentPeriod) {
      document_made_ = now;
      const ViewHub::Text document = message("document", document_.document());
      hub_.offer(document);
      budget_.spend(document->size());
    }
    std::string text = document_.text();
    const std::lock_guard lock(mutex_);
    text_.swap(text);
  }

  LiveOutlet& outlet_;
  ViewHub hub_;
  LiveImages images_;
  ViewBudget budget_;
  LiveDocument document_;
  const std::string page_;  ///< empty: not installed
  double document_made_ = 0;
  std::mutex mutex_;  ///< between this thread and the answering ones
  std::string text_;
  std::unique_ptr<ViewServer> server_;
  ViewAddress address_;
  std::string url_;
};

ViewThread::ViewThread(LiveOutlet& outlet, const ViewAddress& address, const std::string& name,
                       const Rig& rig)
    : Follower(std::make_unique<Work>(outlet, address, name, rig)) {}

std::string ViewThread::url() const { return static_cast<const Work&>(*work_).url(); }

}  // namespace swiftlet
