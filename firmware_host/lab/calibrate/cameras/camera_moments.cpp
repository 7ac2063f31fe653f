#include "firmware_host/lab/calibrate/cameras/camera_moments.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "estimator/core/median.hpp"
#include "firmware_host/lab/calibrate/board/same_moment.hpp"
#include "firmware_host/lab/calibrate/cameras/board_pose.hpp"

namespace swiftlet {
namespace {

/// At least two tags, or a small checkerboard.
constexpr std::size_t kFewestInView = 8;

/// Centre, extent and slant of the board in the image, in image widths, for both cameras. A camera without
/// the board is far from all that see it.
using Look = Eigen::Matrix<double, 10, 1>;

Look lookOf(const Moment& moment, const std::array<CameraModel, kMaxCameras>& sizes) {
  constexpr double kAbsent = 3;
  Look look = Look::Constant(kAbsent);
  for (std::size_t c = 0; c < kMaxCameras; ++c) {
    if (moment.seen[c] == nullptr) continue;
    const double width = std::max(1, sizes[c].width());
    const auto count = static_cast<double>(moment.seen[c]->corners.size());
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const BoardCorner& corner : moment.seen[c]->corners) mean += corner.pixel / (width * count);
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (const BoardCorner& corner : moment.seen[c]->corners) {
      const Eigen::Vector2d d = corner.pixel / width - mean;
      spread += d * d.transpose() / count;
    }
    const double x = std::sqrt(spread(0, 0));
    const double y = std::sqrt(spread(1, 1));
    look.segment<5>(static_cast<Eigen::Index>(5 * c)) << mean, x, y,
        spread(0, 1) / std::max(1e-9, x * y) * 0.3;
  }
  return look;
}

/// Natural logarithm of the determinant of a matrix normalized by `scale`.
double logDeterminant(const Eigen::MatrixXd& A, const Eigen::VectorXd& scale) {
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * A * scale.asDiagonal());
  if (factor.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  return 2 * factor.matrixLLT().diagonal().array().log().sum();
}

std::optional<SE3> poseOf(const CalibrationTarget& target, const Moment& moment, const CameraBundle& bundle,
                          double most_rms) {
  for (std::size_t c = 0; c < bundle.camera_count; ++c) {
    if (moment.seen[c] == nullptr) continue;
    const std::optional<SE3> T = boardPose(target, bundle.lens[c], *moment.seen[c], most_rms);
    if (!T) continue;
    return c == 0 ? *T : bundle.T_cam1_cam0.inverse() * *T;
  }
  return std::nullopt;
}

std::vector<Stamp> stampsOf(const std::vector<BoardView>& views, std::size_t camera) {
  std::vector<Stamp> stamps;
  for (const BoardView& view : views) {
    if (view.camera == camera) stamps.push_back(view.stamp);
  }
  std::sort(stamps.begin(), stamps.end());
  return stamps;
}

double medianSeconds(std::vector<double> values) { return values.empty() ? 0 : medianOf(values); }

/// s, median. From all images, with and without the board. Differences above half the image period are those
/// of images without a partner: one that was lost, or left out because it does not show the board.
double stampDifference(const std::vector<BoardView>& views) {
  const std::vector<Stamp> first = stampsOf(views, 0);
  const std::vector<Stamp> second = stampsOf(views, 1);
  if (second.empty()) return 0;
  std::vector<double> periods;
  for (std::size_t i = 1; i < first.size(); ++i) periods.push_back((first[i] - first[i - 1]).seconds());
  const double half = 0.5 * medianSeconds(periods);
  std::vector<double> differences;
  std::size_t nearest = 0;
  for (const Stamp stamp : first) {
    const auto apart = [&](std::size_t i) { return std::abs((second[i] - stamp).seconds()); };
    while (nearest + 1 < second.size() && apart(nearest + 1) <= apart(nearest)) ++nearest;
    if (apart(nearest) <= half) differences.push_back(apart(nearest));
  }
  return medianSeconds(std::move(differences));
}

}  // namespace

Moments pairViews(const std::vector<BoardView>& views, std::size_t camera_count) {
  std::array<std::vector<const BoardView*>, kMaxCameras> of;
  for (const BoardView& view : views) {
    if (view.corners.size() >= kFewestInView && view.camera < camera_count) of[view.camera].push_back(&view);
  }
  const auto earlier = [](const BoardView* a, const BoardView* b) { return a->stamp < b->stamp; };
  for (auto& list : of) std::stable_sort(list.begin(), list.end(), earlier);
  Moments moments;
  std::size_t second = 0;
  for (const BoardView* first : of[0]) {
    Moment moment{first->stamp, {first, nullptr}};
    const auto apart = [&](std::size_t i) { return std::abs((of[1][i]->stamp - first->stamp).seconds()); };
    while (second + 1 < of[1].size() && apart(second + 1) <= apart(second)) ++second;
    if (second < of[1].size() && apart(second) <= kSameMoment) moment.seen[1] = of[1][second];
    moments.all.push_back(moment);
  }
  std::vector<const BoardView*> paired;
  for (const Moment& moment : moments.all) paired.push_back(moment.seen[1]);
  for (const BoardView* view : of[1]) {
    if (std::find(paired.begin(), paired.end(), view) == paired.end()) {
      moments.all.push_back({view->stamp, {nullptr, view}});
    }
  }
  std::stable_sort(moments.all.begin(), moments.all.end(),
                   [](const Moment& a, const Moment& b) { return a.stamp < b.stamp; });
  if (camera_count > 1) moments.stamp_difference = stampDifference(views);
  return moments;
}

std::vector<const Moment*> spreadMoments(const std::vector<const Moment*>& moments,
                                         const std::array<CameraModel, kMaxCameras>& sizes,
                                         std::size_t count) {
  std::vector<const Moment*> chosen;
  if (moments.empty()) return chosen;
  std::vector<Look> looks;
  for (const Moment* moment : moments) looks.push_back(lookOf(*moment, sizes));
  std::vector<double> distance(moments.size(), std::numeric_limits<double>::infinity());
  // Starts with the moment with the most corners.
  const auto corners = [](const Moment* m) {
    std::size_t sum = 0;
    for (const BoardView* view : m->seen) sum += view == nullptr ? 0 : view->corners.size();
    return sum;
  };
  std::size_t next = 0;
  for (std::size_t i = 1; i < moments.size(); ++i) {
    if (corners(moments[i]) > corners(moments[next])) next = i;
  }
  while (chosen.size() < count && distance[next] > 0) {
    chosen.push_back(moments[next]);
    for (std::size_t i = 0; i < moments.size(); ++i) {
      distance[i] = std::min(distance[i], (looks[i] - looks[next]).norm());
    }
    distance[next] = 0;
    next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  return chosen;
}

void chooseInformative(const CalibrationTarget& target, const std::vector<Moment>& candidates,
                       double most_rms, std::size_t count, CameraBundle& bundle) {
  struct Candidate {
    BundleView view;
    Eigen::MatrixXd information;
    double gain = std::numeric_limits<double>::infinity();
  };
  std::vector<Candidate> open;
  for (const Moment& moment : candidates) {
    const std::optional<SE3> pose = poseOf(target, moment, bundle, most_rms);
    if (!pose) continue;
    Candidate candidate;
    candidate.view.stamp = moment.stamp;
    candidate.view.T_cam0_board = *pose;
    for (std::size_t c = 0; c < bundle.camera_count; ++c) {
      if (moment.seen[c] != nullptr) candidate.view.add(target, c, *moment.seen[c]);
    }
    candidate.information = bundle.information(candidate.view);
    open.push_back(std::move(candidate));
  }
  bundle.views.clear();
  if (open.empty()) return;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(bundle.globalCount(), bundle.globalCount());
  for (const Candidate& candidate : open) total += candidate.information;
  const Eigen::VectorXd scale = total.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  // Weak initial information, so that the first views have a finite gain: a millionth of that of all views.
  Eigen::MatrixXd A = 1e-6 * total.diagonal().asDiagonal().toDenseMatrix();
  double value = logDeterminant(A, scale);
  // A view's gain never increases when others are added: only the best few are computed again.
  while (bundle.views.size() < count && !open.empty()) {
    std::size_t best = 0;
    double best_gain = -std::numeric_limits<double>::infinity();
    std::stable_sort(open.begin(), open.end(),
                     [](const Candidate& a, const Candidate& b) { return a.gain > b.gain; });
    for (std::size_t i = 0; i < open.size() && open[i].gain > best_gain; ++i) {
      open[i].gain = logDeterminant(A + open[i].information, scale) - value;
      if (open[i].gain > best_gain) {
        best_gain = open[i].gain;
        best = i;
      }
    }
    A += open[best].information;
    value += best_gain;
    bundle.views.push_back(std::move(open[best].view));
    open.erase(open.begin() + static_cast<std::ptrdiff_t>(best));
  }
  std::stable_sort(bundle.views.begin(), bundle.views.end(),
                   [](const BundleView& a, const BundleView& b) { return a.stamp < b.stamp; });
}

}  // namespace swiftlet
