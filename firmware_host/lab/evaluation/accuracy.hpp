#pragma once
// All figures of one trajectory against the truth, over one section of the flight.

#include <vector>

#include "firmware_host/lab/evaluation/association.hpp"
#include "firmware_host/lab/evaluation/relative_error.hpp"
#include "firmware_host/lab/evaluation/trajectory_error.hpp"

namespace swiftlet {

struct AccuracyOptions {
  AssociationOptions association;
  AlignKind align = AlignKind::kSe3;
  Duration rpe_delta = Duration::fromSeconds(1);
};

struct Accuracy {
  std::size_t estimates = 0;                 ///< poses in the section
  std::size_t pairs = 0;                     ///< of these, with truth
  Duration max_gap;                          ///< of the association: largest gap of the truth
  double duration = 0;                       ///< s from the first pair to the last
  TrajectoryError absolute;                  ///< ATE
  RelativeError over_time;                   ///< RPE
  std::vector<RelativeError> over_distance;  ///< for each of kSegmentLengths that has segments

  [[nodiscard]] double coverage() const {
    return estimates == 0 ? 0 : static_cast<double>(pairs) / static_cast<double>(estimates);
  }
};

Accuracy accuracyOf(const Trajectory& estimate, const Trajectory& truth, const AccuracyOptions& options);

}  // namespace swiftlet
