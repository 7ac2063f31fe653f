#include "estimator/smoother/full_smoother.hpp"

#include <Eigen/Cholesky>
#ifdef SWIFTLET_WITH_CHOLMOD
#include <Eigen/CholmodSupport>
#else
#include <Eigen/SparseCholesky>
#endif
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/scan_turn.hpp"
#include "estimator/smoother/full_smoother_system.hpp"
#include "estimator/smoother/imu_factor.hpp"
#include "estimator/smoother/landmark_block.hpp"

namespace swiftlet {
namespace {

constexpr double kGaugeSigma = 1e-4;      // m, rad: holds position and yaw of the first keyframe
constexpr double kGyroBiasSigma = 0.1;    // rad/s, prior on the first keyframe of an epoch
constexpr double kAccelBiasSigma = 0.15;  // m/s^2
constexpr double kOutlierSigmas = 3.5;
constexpr double kRelativeConvergence = 1e-5;  // of the cost
constexpr int kOutlierRounds = 2;              // iterations after which outliers are removed
constexpr int kTriangulationIterations = 5;
constexpr double kKeptAhead = 0.1;    // s of samples kept after a keyframe, for interpolation
constexpr double kLongestLink = 5.0;  // s; the covariance of a longer increment is meaningless
constexpr double kDampingUp = 10.0;
// Relative to the diagonal; only against rounding. Images determine a pose much better than the IMU
// determines the scale of one camera, so with 1e-6 the scale would need a hundred iterations.
constexpr double kDampingStart = 1e-10;
constexpr double kFirstMatchGate = 30;  // sigmas, after pulling with the loops' relative poses
constexpr int kPullIterations = 10;
constexpr std::size_t kMostSightings = 120;  // per landmark: 20 s at 6 keyframes a second
constexpr double kPulledEnough = 2e-3;       // m, rad: largest step of a pose
constexpr Status kStopped{StatusCode::kFailed, kFullSmoothingStopped};

// Without CHOLMOD (a GPL library, see docs/licences.md) Eigen's own factorization is used: the same steps to
// rounding, but slower on long runs.
#ifdef SWIFTLET_WITH_CHOLMOD
using SparseFactor = Eigen::CholmodDecomposition<Eigen::SparseMatrix<double>, Eigen::Lower>;
#else
using SparseFactor = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower>;
#endif

}  // namespace

/// Factors the system and solves it. Kept between iterations.
class FullSmoother::Solver {
 public:
  Status solve(System& system, double damping, Eigen::VectorXd& step) {
    const Eigen::SparseMatrix<double>& H = system.matrix(damping);
    if (system.takeNewPattern()) factor_.analyzePattern(H);
    factor_.factorize(H);
    if (factor_.info() != Eigen::Success) {
      return {StatusCode::kNumerical, "the full system could not be factored"};
    }
    step = factor_.solve(-system.g);
    if (!step.allFinite()) return {StatusCode::kNumerical, "the full system's solution is not finite"};
    return okStatus();
  }

 private:
  SparseFactor factor_;
};

FullSmoother::FullSmoother(const Rig& rig, const ImuNoise& noise, const FullSmootherSettings& settings)
    : rig_(rig),
      noise_(noise),
      monitor_(noise),
      settings_(settings),
      next_revisit_track_(std::numeric_limits<TrackId>::max()) {}

void FullSmoother::addImu(const ImuSample& sample) {
  if (monitor_.check(sample).learned) noise_ = monitor_.noise();
  pending_imu_.push_back(sample);
}

void FullSmoother::addKeyframe(const TrackedFrame& frame, const NavState& state, const NoiseInUse& noise) {
  Keyframe keyframe;
  keyframe.stamp = frame.stamp;
  keyframe.epoch = state.epoch;
  keyframe.x = {state.T_world_body, state.v_world_body, state.bias_gyro, state.bias_accel};
  keyframe.noise = noise;
  const Stamp at = frame.stamp + rig_.camera_to_imu_shift;
  if (!keyframes_.empty() && keyframes_.back().epoch == state.epoch) {
    const double dt = (frame.stamp - keyframes_.back().stamp).seconds();
    keyframe.linked = dt > 0 && dt < kLongestLink && !pending_imu_.empty();
    keyframe.samples = pending_imu_;
  }
  std::erase_if(pending_imu_,
                [&](const ImuSample& s) { return s.stamp < at - Duration::fromSeconds(kKeptAhead); });
  const auto slot = static_cast<std::uint32_t>(keyframes_.size());
  for (const TrackedFeature& feature : frame.features) {
    const Sighting sighting = makeSighting(rig_, feature.seen, feature.pixel, noise.pixel_sigma, slot);
    if (sighting.any()) addSighting({state.epoch, feature.id}, sighting);
  }
  worlds_.try_emplace(state.epoch, state.epoch);
  keyframes_.push_back(std::move(keyframe));
}

void FullSmoother::setCalibration(const CalibrationEstimate& calibration) {
  const bool later = calibration.camera_to_imu_shift > rig_.camera_to_imu_shift;
  rig_.camera_to_imu_shift = calibration.camera_to_imu_shift;
  rig_.readout = calibration.readout;
  rig_.T_body_cam = calibration.T_body_cam;
  intrinsics_ = calibration.gyro;
  // The samples of a keyframe ended at its stamp with the old time shift; later ones are stored with the next
  // keyframe.
  for (std::size_t k = 1; later && k + 1 < keyframes_.size(); ++k) {
    std::vector<ImuSample>& samples = keyframes_[k].samples;
    const Stamp end = keyframes_[k].stamp + rig_.camera_to_imu_shift + Duration::fromSeconds(kKeptAhead);
    for (const ImuSample& sample : keyframes_[k + 1].samples) {
      const bool behind = !samples.empty() && sample.stamp > samples.back().stamp;
      if (behind && sample.stamp < end) samples.push_back(sample);
    }
  }
}

void FullSmoother::addSighting(const TrackKey& key, const Sighting& sighting) {
  Track& track = tracks_[key];
  if (track.sightings.size() < kMostSightings) {
    track.sightings.push_back(sighting);
    return;
  }
  // Continue as a new landmark: at rest one track would otherwise connect all keyframes with each other.
  auto full = tracks_.extract(key);
  full.key().second = next_revisit_track_--;
  tracks_.insert(std::move(full));
  tracks_[key].sightings.push_back(sighting);
}

NavState FullSmoother::state(std::size_t k) const {
  const Keyframe& keyframe = keyframes_[k];
  NavState state;
  state.stamp = keyframe.stamp;
  state.epoch = keyframe.epoch;
  state.health = Health::kGood;
  state.T_world_body = keyframe.x.T_world_body;
  state.v_world_body = keyframe.x.v_world_body;
  state.bias_gyro = keyframe.x.bias_gyro;
  state.bias_accel = keyframe.x.bias_accel;
  return state;
}

void FullSmoother::placeCameras() {
  poses_.resize(keyframes_.size());
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    const Keyframe& keyframe = keyframes_[k];
    poses_[k].v_world = keyframe.x.v_world_body;
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      poses_[k].place(c, rig_.T_body_cam[c], keyframe.x.T_world_body, rig_.readout.seconds(), keyframe.scan);
    }
  }
}

void FullSmoother::integrateLinks() {
  for (std::size_t k = 1; k < keyframes_.size(); ++k) {
    Keyframe& keyframe = keyframes_[k];
    if (!keyframe.linked) continue;
    const Keyframe& before = keyframes_[k - 1];
    keyframe.imu = Preintegration(noise_.times(keyframe.noise.imu), before.x.bias_gyro, before.x.bias_accel,
                                  intrinsics_);
    keyframe.linked = keyframe.imu
                          .integrate(keyframe.samples, before.stamp + rig_.camera_to_imu_shift,
                                     keyframe.stamp + rig_.camera_to_imu_shift)
                          .ok();
  }
  for (std::size_t k = 0; rig_.rolls() && k < keyframes_.size(); ++k) {
    Keyframe& keyframe = keyframes_[k];
    // Samples after a keyframe are stored with the next one.
    const bool last = k + 1 == keyframes_.size() || keyframes_[k + 1].samples.empty();
    keyframe.scan =
        scanTurn(last ? keyframe.samples : keyframes_[k + 1].samples,
                 keyframe.stamp + rig_.camera_to_imu_shift, rig_.readout, keyframe.x.bias_gyro, intrinsics_);
  }
}

void FullSmoother::triangulateAll() {
  for (auto& [id, track] : tracks_) {
    track.in_system = track.sightings.size() >= 2 &&
                      triangulate(poses_, track.sightings, kTriangulationIterations, track.point);
  }
}

void FullSmoother::removeOutliers() {
  for (auto& [id, track] : tracks_) {
    if (!track.in_system) continue;
    for (Sighting& sighting : track.sightings) {
      for (std::size_t c = 0; c < rig_.camera_count; ++c) {
        CameraSighting& view = sighting.camera[c];
        if (!view.used) continue;
        Eigen::Vector2d r;
        view.used = reprojectionResidual(view, poses_[sighting.slot].current[c], track.point, r) &&
                    r.squaredNorm() < kOutlierSigmas * kOutlierSigmas;
      }
    }
    std::erase_if(track.sightings, [](const Sighting& s) { return !s.any(); });
    track.in_system = track.sightings.size() >= 2;
  }
}

double FullSmoother::linearizeTrack(const Track& track, System& system) const {
  LandmarkBlock& landmark = system.landmark;
  landmark.linearize({track.sightings, poses_, rig_.T_body_cam, {}}, track.point);
  if (!landmark.eliminate()) return 0;
  const auto states = landmark.states();
  for (std::size_t i = 0; i < states.size(); ++i) {
    const std::size_t row = states[i].slot;
    system.g.segment<kPoseDim>(kStateDim * static_cast<Eigen::Index>(row)) +=
        Eigen::Map<const Vector6d>(states[i].gradient);
    system.poseBlock(row, row).add(states[i].information);
    const PairProduct product(states[i]);
    for (std::size_t j = 0; j < i; ++j) {
      product.subtract(states[j], system.poseBlock(row, states[j].slot));
    }
  }
  return landmark.cost();
}

void FullSmoother::linearizeMotion(System& system, double& cost) const {
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    const Keyframe& keyframe = keyframes_[k];
    const Eigen::Index at = kStateDim * static_cast<Eigen::Index>(k);
    if (k == 0 || keyframes_[k - 1].epoch != keyframe.epoch) {
      Eigen::Matrix<double, kStateDim, kStateDim> prior = Eigen::Matrix<double, kStateDim, kStateDim>::Zero();
      // An epoch joined to an earlier one by loops gets its position and yaw from there.
      const bool own_world = world(k) == keyframe.epoch;
      const double gauge = own_world ? 1.0 / (kGaugeSigma * kGaugeSigma) : 0.0;
      const Eigen::Vector3d up = keyframe.x.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
      prior.block<3, 3>(0, 0) = gauge * up * up.transpose();
      prior.block<3, 3>(3, 3) = gauge * Eigen::Matrix3d::Identity();
      prior.block<3, 3>(9, 9) = Eigen::Matrix3d::Identity() / (kGyroBiasSigma * kGyroBiasSigma);
      prior.block<3, 3>(12, 12) = Eigen::Matrix3d::Identity() / (kAccelBiasSigma * kAccelBiasSigma);
      system.own(k) += prior;
      system.g.segment<3>(at + 9) += keyframe.x.bias_gyro / (kGyroBiasSigma * kGyroBiasSigma);
      system.g.segment<3>(at + 12) += keyframe.x.bias_accel / (kAccelBiasSigma * kAccelBiasSigma);
      continue;
    }
    MotionFactor factor;
    const BodyState& x_i = keyframes_[k - 1].x;
    const double dt = (keyframe.stamp - keyframes_[k - 1].stamp).seconds();
    const bool valid = keyframe.linked ? imuFactor(keyframe.imu, noise_, x_i, keyframe.x, factor)
                                       : constantVelocityFactor(dt, noise_, x_i, keyframe.x, factor);
    if (!valid) continue;
    cost += 0.5 * factor.residual.squaredNorm();
    system.own(k - 1) += factor.jacobian_i.transpose() * factor.jacobian_i;
    system.before(k) += factor.jacobian_j.transpose() * factor.jacobian_i;
    system.own(k) += factor.jacobian_j.transpose() * factor.jacobian_j;
    system.g.segment<kStateDim>(at - kStateDim) += factor.jacobian_i.transpose() * factor.residual;
    system.g.segment<kStateDim>(at) += factor.jacobian_j.transpose() * factor.residual;
  }
}

double FullSmoother::linearize(System& system) {
  system.clear();
  double cost = 0;
  for (const auto& [id, track] : tracks_) {
    if (stopped()) return cost;
    if (track.in_system) cost += linearizeTrack(track, system);
  }
  linearizeMotion(system, cost);
  return cost;
}

// Ties every pair of keyframes that can become connected: matches are added and withdrawn during the solve.
void FullSmoother::tieAll(System& system) const {
  system.start(keyframes_.size());
  std::map<TrackKey, std::vector<std::uint32_t>> further;
  for (const Match& match : matches_) further[match.track].push_back(match.sighting.slot);
  std::vector<std::uint32_t> seen;
  for (const auto& [key, track] : tracks_) {
    seen.clear();
    for (const Sighting& sighting : track.sightings) seen.push_back(sighting.slot);
    if (const auto at = further.find(key); at != further.end()) {
      seen.insert(seen.end(), at->second.begin(), at->second.end());
      std::ranges::sort(seen);
      seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    }
    system.tie(seen);
  }
  for (const Revisit& revisit : revisits_) {
    const std::array pair{static_cast<std::uint32_t>(revisit.old_keyframe),
                          static_cast<std::uint32_t>(revisit.new_keyframe)};
    system.tie(pair);
  }
}

Status FullSmoother::solve(FullSmootherReport& report, const std::atomic<bool>* stop) {
  stop_ = stop;
  if (keyframes_.size() < 3) return {StatusCode::kNotReady, "full smoothing needs three keyframes"};
  System system;
  Solver solver;
  tieAll(system);
  if (!revisits_.empty()) {
    joinWorlds();
    const Status pulled = pullTogether(solver, system);
    if (!pulled.ok()) return pulled;
  }
  std::vector<BodyState> before(keyframes_.size());
  Eigen::VectorXd step;
  double damping = kDampingStart;
  double cost = 0;
  for (int iteration = 0;; ++iteration) {
    integrateLinks();
    placeCameras();
    triangulateAll();
    const bool look_for_outliers = iteration == kOutlierRounds || iteration == 2 * kOutlierRounds;
    if (!revisits_.empty()) {
      if (iteration == 0) chooseMatches(kFirstMatchGate);
      if (look_for_outliers) chooseMatches(kOutlierSigmas);
      tieWorlds(true);
    }
    if (look_for_outliers) removeOutliers();
    const bool comparable = iteration > 2 * kOutlierRounds;
    const double new_cost = linearize(system);
    if (stopped()) return kStopped;
    if (iteration == 0) report.initial_cost = new_cost;
    if (comparable && new_cost > cost) {
      for (std::size_t k = 0; k < keyframes_.size(); ++k) keyframes_[k].x = before[k];
      if (iteration == settings_.max_iterations || new_cost - cost < kRelativeConvergence * cost) break;
      damping *= kDampingUp;
      placeCameras();
      triangulateAll();
      linearize(system);
      if (stopped()) return kStopped;
    } else {
      const bool converged = comparable && cost - new_cost < kRelativeConvergence * cost;
      cost = new_cost;
      if (converged || iteration == settings_.max_iterations) break;
    }
    report.iterations = iteration + 1;
    const Status solved = solver.solve(system, damping, step);
    if (!solved.ok()) return solved;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) before[k] = keyframes_[k].x;
    retractAll(step);
  }
  report.final_cost = cost;
  fillReport(report);
  return okStatus();
}

void FullSmoother::retractAll(const Eigen::VectorXd& step) {
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    keyframes_[k].x.retract(step.segment<kStateDim>(kStateDim * static_cast<Eigen::Index>(k)));
  }
}

// Iterates with the loops' relative poses and all other factors until the keyframes stop moving. The matches
// are then close enough to their landmarks to be used as observations.
Status FullSmoother::pullTogether(Solver& solver, System& system) {
  tieWorlds(false);
  Eigen::VectorXd step;
  for (int iteration = 0; iteration < kPullIterations; ++iteration) {
    integrateLinks();
    placeCameras();
    triangulateAll();
    linearize(system);
    linearizeRevisits(system);
    if (stopped()) return kStopped;
    const Status solved = solver.solve(system, kDampingStart, step);
    if (!solved.ok()) return solved;
    retractAll(step);
    double largest = 0;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      const auto pose = step.segment<kPoseDim>(kStateDim * static_cast<Eigen::Index>(k));
      largest = std::max(largest, pose.cwiseAbs().maxCoeff());
    }
    if (largest < kPulledEnough) break;
  }
  forgetPoints();
  return okStatus();
}

void FullSmoother::fillReport(FullSmootherReport& report) const {
  report.keyframes = keyframes_.size();
  report.landmarks = static_cast<std::size_t>(std::count_if(
      tracks_.begin(), tracks_.end(), [](const auto& entry) { return entry.second.in_system; }));
  report.revisits = revisits_.size();
  report.matches = matches_.size();
  report.revisits_used = 0;
  report.matches_used = 0;
  for (const Revisit& revisit : revisits_) {
    const std::size_t used = matchesInSystem(revisit);
    report.matches_used += used;
    if (used > 0) ++report.revisits_used;
  }
}

}  // namespace swiftlet
