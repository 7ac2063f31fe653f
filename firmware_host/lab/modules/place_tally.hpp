#pragma once
// Counts for `swiftlet place`: candidates and loops compared with the given poses, and their computing time.
//
// According to the poses, two images show the same place if they are within 1 m and 30 degrees of each other
// (the measure of evaluation/revisits.hpp). There may still be a wall between them, and images farther apart
// that see the same place count neither way. A verified pose is false if it deviates by more than
// evaluation/loop_accuracy.hpp allows.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "firmware_host/realtime/latency_histogram.hpp"
#include "mapping/place/loop_verification.hpp"

namespace swiftlet {

/// Header line of places.csv.
std::string placeColumns();

/// The columns of geometry, starting with a comma. `truth`: T_old_new from the poses, if `judged`.
std::string verificationText(const LoopVerification& result, const SE3& truth, bool judged);

class PlaceTally {
 public:
  void begin(Stamp stamp, std::uint32_t epoch, const SE3& T_world_body);
  void addCandidate(const SE3& truth, bool judged);
  void addVerification(const LoopVerification& result, const SE3& truth, bool judged);
  /// `exclude` [s]: images closer in time are no revisit.
  void end(double exclude);
  void write(nlohmann::ordered_json& summary) const;

  LatencyHistogram recognition;   ///< CPU s: features, words, query, storing
  LatencyHistogram verification;  ///< CPU s per candidate

 private:
  struct Image {
    Stamp stamp;
    std::uint32_t epoch = 0;
    SE3 T_world_body;
  };
  [[nodiscard]] bool revisits(double exclude) const;

  std::vector<Image> images_;
  bool proposed_ = false;  ///< a candidate shows the place of the current image
  bool closed_ = false;    ///< and one of these was verified correctly
  std::uint64_t revisiting_ = 0, revisiting_proposed_ = 0, revisiting_closed_ = 0;
  std::uint64_t candidates_ = 0, judged_candidates_ = 0, near_candidates_ = 0;
  std::uint64_t accepted_ = 0, judged_ = 0, right_ = 0;
  std::array<std::uint64_t, kLoopFates> fates_{};
  std::vector<double> metres_, degrees_;  ///< of the correct loops
};

}  // namespace swiftlet
