#include "firmware_host/lab/playback/run_player.hpp"

#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/page/page.hpp"
#include "firmware_host/outputs/view/view_hub.hpp"
#include "firmware_host/outputs/view/view_server.hpp"

namespace swiftlet {
namespace {

std::string pageOf(const ReportedRun& run) {
  const ReportProgram program = readReportProgram();
  if (program.name.empty()) {
    throw InputError("view", 0, "", "this installation has no page (share/swiftlet/report_page.html)",
                     "Build swiftlet where npm is installed, or use `swiftlet report --plain`");
  }
  return pageWith(program.text, program.name, reportDocument({run}));
}

}  // namespace

class RunPlayer::Work {
 public:
  Work(const ReportedRun& run, std::unique_ptr<RunMoments> moments, const ViewAddress& address)
      : page_(pageOf(run)), moments_(std::move(moments)) {
    // A page of an earlier live view that asks for its stream is refused.
    hub_.end();
    ViewPages pages;
    pages.page = [this] { return page_; };
    pages.text = [] { return std::string("The page is at /\n"); };
    pages.moment = [this](std::size_t moment) { return momentText(moment); };
    server_.emplace(hub_, address, std::move(pages));
  }

  [[nodiscard]] std::string url() const { return server_->url(); }

 private:
  std::string momentText(std::size_t moment) {
    const std::lock_guard lock(mutex_);
    return moment < moments_->count() ? moments_->message(moment, kPictures).dump() : std::string();
  }

  ViewHub hub_;
  const std::string page_;
  std::mutex mutex_;  ///< shared by the answering threads
  const std::unique_ptr<RunMoments> moments_;
  std::optional<ViewServer> server_;
};

RunPlayer::RunPlayer(ReportedRun run, std::unique_ptr<RunMoments> moments, const ViewAddress& address) {
  run.moments = servedMoments(*moments, "moment");
  work_ = std::make_unique<Work>(run, std::move(moments), address);
}
RunPlayer::~RunPlayer() = default;
std::string RunPlayer::url() const { return work_->url(); }

}  // namespace swiftlet
