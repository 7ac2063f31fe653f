#pragma once
// The label images of a log: `mav0/labels0`, a folder like a camera's with data.csv and 8-bit grey PNG whose
// values are labels, in camera 0's raw (distorted) geometry. Some frames may have none.
//
// Host side: opening allocates and throws InputError. at() decodes into one buffer, valid until the next
// call.

#include <string>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/image_list.hpp"
#include "drivers/recorded/log_warnings.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

class LabelImages {
 public:
  /// `log`: the sequence, its mav0 or an archive; if it has no label images, at() never returns one.
  LabelImages(const std::string& log, ImageSize size, LogWarnings& warnings);

  /// The image with exactly this stamp; empty if there is none. Missing, damaged or wrongly sized files are
  /// reported, counted and skipped.
  ImageView at(Stamp stamp);

  [[nodiscard]] std::size_t listed() const { return rows_.size(); }
  [[nodiscard]] const LogCounters& counters() const { return counters_; }

 private:
  AslFiles files_;
  ImageSize size_;
  LogWarnings& warnings_;
  LogCounters counters_;
  std::vector<ImageRow> rows_;  ///< by stamp
  ImageDecoder decoder_;
  std::vector<std::uint8_t> bytes_;
  std::vector<std::uint8_t> pixels_;
};

}  // namespace swiftlet
