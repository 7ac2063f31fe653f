#pragma once
// Shows a finished run on the report's page, with the images of its log moment by moment (docs/report.md):
// `swiftlet view`.
//
// The page has its whole document from the start; GET /moment?i=N returns one of RunMoments' messages.
// Requests are answered one after the other, in the view server's threads and within its limits.

#include <memory>
#include <string>

#include "firmware_host/lab/report/report_document.hpp"
#include "firmware_host/lab/report/run_moments.hpp"
#include "firmware_host/outputs/view/view_address.hpp"

namespace swiftlet {

class RunPlayer {
 public:
  /// Size limits of a moment's pictures.
  static constexpr PictureBounds kPictures = {800, std::size_t{400} * 1024};

  /// Starts listening. InputError if the address is not available, or if the page is not installed.
  RunPlayer(ReportedRun run, std::unique_ptr<RunMoments> moments, const ViewAddress& address);
  ~RunPlayer();
  RunPlayer(const RunPlayer&) = delete;
  RunPlayer& operator=(const RunPlayer&) = delete;

  [[nodiscard]] std::string url() const;

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace swiftlet
