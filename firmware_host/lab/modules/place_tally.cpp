#include "firmware_host/lab/modules/place_tally.hpp"

#include <fmt/format.h>

#include <cmath>

#include "estimator/core/units.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/evaluation/error_statistics.hpp"
#include "firmware_host/lab/evaluation/loop_accuracy.hpp"
#include "firmware_host/lab/evaluation/revisits.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

struct PoseDistance {
  double metres = 0;
  double degrees = 0;
};

PoseDistance between(const SE3& a, const SE3& b) {
  const SE3 difference = a.inverse() * b;
  return {difference.translation.norm(), logSo3(difference.rotation).norm() * kToDegrees};
}

bool samePlace(const SE3& T_a_b) {
  const PoseDistance d = between(SE3{}, T_a_b);
  return d.metres < RevisitOptions{}.max_distance && d.degrees < RevisitOptions{}.max_turn_deg;
}

bool isRight(const PoseDistance& error) {
  return error.metres <= kFalseLoopDistance && error.degrees <= kFalseLoopDegrees;
}

/// Null if `all` is 0.
Json share(std::uint64_t part, std::uint64_t all) {
  return all == 0 ? Json(nullptr) : Json(static_cast<double>(part) / static_cast<double>(all));
}

Json timeJson(const LatencyHistogram& cpu) {
  return {{"count", cpu.count()},
          {"p50_ms", cpu.percentile(0.5) * kToMs},
          {"p99_ms", cpu.percentile(0.99) * kToMs},
          {"max_ms", cpu.max() * kToMs}};
}

}  // namespace

std::string placeColumns() {
  return "#query [ns],old [ns],score,relative score,consistent,truth distance [m],truth turn "
         "[deg],fate,matches,"
         "inliers,p_x [m],p_y [m],p_z [m],q_x [],q_y [],q_z [],q_w [],sigma_rotation [rad],"
         "sigma_translation [m],error [m],error [deg]";
}

std::string verificationText(const LoopVerification& result, const SE3& truth, bool judged) {
  std::string text = fmt::format(",{},{},{}", describe(result.fate), result.matches, result.inliers.size());
  if (!result.accepted()) return text;
  const Eigen::Vector3d& p = result.T_old_new.translation;
  const Eigen::Quaterniond& q = result.T_old_new.rotation;
  const Vector6d variance = result.covariance.diagonal();
  text += fmt::format(",{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.4g},{:.4g}", p.x(), p.y(), p.z(),
                      q.x(), q.y(), q.z(), q.w(), std::sqrt(variance.head<3>().maxCoeff()),
                      std::sqrt(variance.tail<3>().maxCoeff()));
  if (!judged) return text;
  const PoseDistance error = between(truth, result.T_old_new);
  return text + fmt::format(",{:.6g},{:.6g}", error.metres, error.degrees);
}

void PlaceTally::begin(Stamp stamp, std::uint32_t epoch, const SE3& T_world_body) {
  images_.push_back({stamp, epoch, T_world_body});
  proposed_ = closed_ = false;
}

void PlaceTally::addCandidate(const SE3& truth, bool judged) {
  ++candidates_;
  if (!judged) return;
  ++judged_candidates_;
  if (!samePlace(truth)) return;
  ++near_candidates_;
  proposed_ = true;
}

void PlaceTally::addVerification(const LoopVerification& result, const SE3& truth, bool judged) {
  ++fates_[static_cast<std::size_t>(result.fate)];
  if (!result.accepted()) return;
  ++accepted_;
  if (!judged) return;
  ++judged_;
  const PoseDistance error = between(truth, result.T_old_new);
  if (!isRight(error)) return;
  ++right_;
  closed_ = true;
  metres_.push_back(error.metres);
  degrees_.push_back(error.degrees);
}

bool PlaceTally::revisits(double exclude) const {
  const Image& now = images_.back();
  for (const Image& old : images_) {
    if ((now.stamp - old.stamp).seconds() < exclude) return false;
    if (old.epoch == now.epoch && samePlace(old.T_world_body.inverse() * now.T_world_body)) return true;
  }
  return false;
}

void PlaceTally::end(double exclude) {
  if (!revisits(exclude)) return;
  ++revisiting_;
  revisiting_proposed_ += proposed_ ? 1 : 0;
  revisiting_closed_ += closed_ ? 1 : 0;
}

void PlaceTally::write(Json& summary) const {
  summary["retrieval"] = {{"candidates", candidates_},
                          {"judged", judged_candidates_},
                          {"of_the_same_place", near_candidates_},
                          {"precision", share(near_candidates_, judged_candidates_)},
                          {"images_revisiting", revisiting_},
                          {"images_with_their_place", revisiting_proposed_},
                          {"recall", share(revisiting_proposed_, revisiting_)}};
  if (verification.count() > 0) {
    Json fates;
    for (std::size_t i = 0; i < kLoopFates; ++i) {
      if (fates_[i] > 0) fates[describe(static_cast<LoopFate>(i))] = fates_[i];
    }
    summary["verification"] = {{"accepted", accepted_},
                               {"judged", judged_},
                               {"right", right_},
                               {"precision", share(right_, judged_)},
                               {"recall", share(revisiting_closed_, revisiting_)},
                               {"median_error_m", statisticsOf(metres_).median},
                               {"median_error_deg", statisticsOf(degrees_).median},
                               {"fates", fates}};
  }
  summary["timing"] = {{"recognition", timeJson(recognition)}, {"verification", timeJson(verification)}};
}

}  // namespace swiftlet
