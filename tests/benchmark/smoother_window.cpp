#include "tests/benchmark/smoother_window.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <map>
#include <stdexcept>

#include "estimator/core/random.hpp"
#include "estimator/smoother/cholesky.hpp"
#include "estimator/smoother/imu_buffer.hpp"
#include "tests/smoother/window_scene.hpp"

namespace swiftlet::test {
namespace {

constexpr std::size_t kPoses = 6;  // as SmootherSettings' defaults make them
constexpr std::size_t kMotionKeyframes = 4;
constexpr std::size_t kRecent = 4;
// As in Smoother::solve.
constexpr int kTriangulationStart = 6;
constexpr double kRelativeDamping = 1e-10;
// How far values are off when an update begins: all states by one common amount (what the new frame
// tells about bias and place), the new state, predicted by the IMU alone, by its own in addition.
constexpr double kCommonPosition = 1e-3;   // m
constexpr double kCommonRotation = 3e-4;   // rad
constexpr double kCommonVelocity = 5e-3;   // m/s
constexpr double kCommonGyroBias = 1e-4;   // rad/s
constexpr double kCommonAccelBias = 2e-3;  // m/s^2
constexpr double kNewPosition = 5e-3;      // m
constexpr double kNewRotation = 1e-3;      // rad
constexpr double kNewVelocity = 2e-2;      // m/s
constexpr int kSolvedBefore = 10;          // iterations that make the window a solved one
constexpr std::size_t kHistory = 8192;     // IMU samples

Vector15d draw(Random& random, double rotation, double position, double velocity) {
  Vector15d delta = Vector15d::Zero();
  delta.head<9>() << randomVector(random, rotation), randomVector(random, position),
      randomVector(random, velocity);
  return delta;
}

}  // namespace

BenchmarkWindow::BenchmarkWindow(const TrackFlight& flight, std::size_t newest)
    : rig(flight.rig()), noise(flight.noise()) {
  chooseStates(flight, newest);
  linkStates(flight);
  addLandmarks(flight);
  eliminated_.resize(landmarks.size());
  makePrior();
  for (const std::uint8_t slot : order) {
    states[slot].offset = dimension_;
    dimension_ += states[slot].dimension();
  }
  step_.resize(dimension_);
  if (!update(kSolvedBefore)) throw std::runtime_error("the window is singular");
  disturb(flight.flight().settings().seed);
}

void BenchmarkWindow::disturb(std::uint64_t seed) {
  Random random(seed, 5);
  Vector15d common = draw(random, kCommonRotation, kCommonPosition, kCommonVelocity);
  common.segment<3>(9) = randomVector(random, kCommonGyroBias);
  common.segment<3>(12) = randomVector(random, kCommonAccelBias);
  for (const std::uint8_t slot : order) states[slot].x.retract(common);
  states[order.back()].x.retract(draw(random, kNewRotation, kNewPosition, kNewVelocity));
}

// The slot is the position in time here; the smoother's code does not care.
void BenchmarkWindow::chooseStates(const TrackFlight& flight, std::size_t newest) {
  std::vector<std::size_t> frames;
  for (std::size_t k = newest + 1; k-- > 0 && frames.size() < kPoses + kMotionKeyframes + kRecent + 1;) {
    if (newest - k <= kRecent || flight.frames()[k].keyframe) frames.push_back(k);
  }
  if (frames.size() < kPoses + kMotionKeyframes + kRecent + 1) throw std::runtime_error("flight too short");
  std::reverse(frames.begin(), frames.end());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    WindowState& state = states[i];
    state.used = true;
    state.stamp = flight.frames()[frames[i]].stamp;
    state.frame_index = frames[i];
    state.has_motion = i >= kPoses;
    state.x = flight.truth(frames[i]);
    order.push_back(static_cast<std::uint8_t>(i));
  }
}

void BenchmarkWindow::linkStates(const TrackFlight& flight) {
  ImuBuffer imu(kHistory);
  for (const ImuSample& sample : flight.flight().imu().samples) imu.push(sample);
  for (std::size_t k = 1; k < order.size(); ++k) {
    const WindowState& previous = states[order[k - 1]];
    WindowState& state = states[order[k]];
    state.link = LinkKind::kImu;
    state.imu = Preintegration(noise, previous.x.bias_gyro, previous.x.bias_accel);
    if (!state.imu.integrate(imu.around(previous.stamp, state.stamp), previous.stamp, state.stamp).ok()) {
      throw std::runtime_error("no IMU samples");
    }
  }
}

void BenchmarkWindow::addLandmarks(const TrackFlight& flight) {
  std::map<TrackId, Landmark> by_id;
  for (const std::uint8_t slot : order) {
    for (const TrackedFeature& feature : flight.frames()[states[slot].frame_index].features) {
      Sighting sighting;
      sighting.slot = slot;
      for (std::size_t c = 0; c < rig.camera_count; ++c) {
        Eigen::Vector3d bearing;
        if (!feature.seen[c] || !rig.camera[c].unproject(feature.pixel[c].cast<double>(), bearing)) continue;
        if (!sightingOf(rig.camera[c], bearing, kPixelSigma, sighting.camera[c])) sighting.camera[c] = {};
      }
      if (!sighting.camera[0].used && !sighting.camera[1].used) continue;
      static_cast<void>(by_id[feature.id].sightings.tryPushBack(sighting));
    }
  }
  placeCameras();
  for (auto& [id, landmark] : by_id) {
    landmark.id = id;
    if (landmark.sightings.size() < 2) continue;
    if (triangulate(poses_, landmark.views(), kTriangulationStart, landmark.point)) {
      landmarks.push_back(landmark);
    }
  }
}

// What is left of the IMU factors between the keyframes that are poses only, once their velocities and
// biases have been eliminated: dense over six poses and the first whole state, as in flight.
void BenchmarkWindow::makePrior() {
  constexpr int kStates = static_cast<int>(kPoses) + 1;
  auto chain = states;
  for (int k = 0; k < kStates; ++k) chain[static_cast<std::size_t>(k)].offset = kStateDim * k;
  system_.begin({}, kStateDim * kStates);
  constexpr std::array<double, 5> kStartSigma{1e-3, 1e-3, 0.05, 5e-3, 0.05};  // rad, m, m/s, rad/s, m/s^2
  for (int i = 0; i < 5; ++i) {
    system_.addDiagonal(chain[0], 3 * i, Eigen::Vector3d::Zero(), kStartSigma[static_cast<std::size_t>(i)]);
  }
  for (std::size_t k = 1; k <= kPoses; ++k) {
    MotionFactor factor;
    if (!motionFactor(k, factor)) throw std::runtime_error("an IMU factor without duration");
    system_.addMotion(factor, chain[k - 1], chain[k]);
  }
  system_.finish(chain);
  std::vector<Eigen::Index> keep;
  std::vector<Eigen::Index> leave;
  prior.begin();
  for (int k = 0; k < kStates; ++k) {
    const WindowState& state = states[static_cast<std::size_t>(k)];
    prior.addBlock(static_cast<std::uint8_t>(k), state.dimension(), state.x);
    for (int i = 0; i < kStateDim; ++i) (i < state.dimension() ? keep : leave).push_back(kStateDim * k + i);
  }
  prior.allocate();
  const Eigen::MatrixXd H = Eigen::MatrixXd(system_.H()).selfadjointView<Eigen::Lower>();
  const Eigen::VectorXd g = system_.g();
  const Eigen::LDLT<Eigen::MatrixXd> eliminated(Eigen::MatrixXd(H(leave, leave)));
  const Eigen::MatrixXd B = H(keep, leave);
  prior.H() = H(keep, keep) - B * eliminated.solve(B.transpose());
  prior.b() = g(keep) - B * eliminated.solve(Eigen::VectorXd(g(leave)));
  const Eigen::LLT<Eigen::MatrixXd> llt{Eigen::MatrixXd(prior.H())};
  if (llt.info() != Eigen::Success) throw std::runtime_error("the prior is not positive definite");
  prior_root = llt.matrixU();
  prior_residual = llt.matrixL().solve(Eigen::VectorXd(prior.b()));
}

void BenchmarkWindow::placeCameras() {
  for (const std::uint8_t slot : order) {
    RigPose& pose = poses_[slot];
    for (std::size_t c = 0; c < rig.camera_count; ++c) {
      pose.current[c] = CameraPose::of(states[slot].x.T_world_body, rig.T_body_cam[c]);
      pose.linearization[c] = pose.current[c];
    }
  }
}

bool BenchmarkWindow::motionFactor(std::size_t position, MotionFactor& factor) const {
  const BodyState& i = states[order[position - 1]].x;
  const BodyState& j = states[order[position]].x;
  return imuFactor(states[order[position]].imu, noise, i, j, factor);
}

Eigen::VectorXd BenchmarkWindow::priorDeviation() const {
  Eigen::VectorXd d(prior.dimension());
  for (const PriorBlock& block : prior.blocks()) {
    d.segment(block.offset, block.dimension) =
        states[block.slot].x.minus(block.reference).head(block.dimension);
  }
  return d;
}

// The prior's blocks are the window's first columns, in the same order.
void BenchmarkWindow::addPrior() {
  const Eigen::Index n = prior.dimension();
  system_.H().topLeftCorner(n, n) += prior.H();
  system_.g().head(n) += prior.b() + prior.H() * priorDeviation();
}

bool BenchmarkWindow::update(int iterations) {
  for (int iteration = 0; iteration < iterations; ++iteration) {
    placeCameras();
    if (iteration == 0) {
      for (Landmark& landmark : landmarks) {
        if (!triangulate(poses_, landmark.views(), 0, landmark.point)) return false;
      }
    }
    system_.begin({}, dimension_);
    addPrior();
    for (std::size_t k = kPoses + 1; k < order.size(); ++k) {
      MotionFactor factor;
      if (!motionFactor(k, factor)) return false;
      system_.addMotion(factor, states[order[k - 1]], states[order[k]]);
    }
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      const LandmarkViews views{landmarks[i].views(), poses_, rig.T_body_cam, {}};
      if (!system_.addLandmark(views, landmarks[i].point, states, &eliminated_[i])) return false;
    }
    system_.finish(states);
    MatrixMap H = system_.H();
    for (int k = 0; k < dimension_; ++k) H(k, k) *= 1.0 + kRelativeDamping;
    if (!choleskyInPlace(H)) return false;
    step_ = -system_.g();
    const VectorMap step(step_.data(), dimension_);
    choleskySolve(H, step);
    const StepOfStates of_states(step, states, 0);
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      LandmarkPoint& point = landmarks[i].point;
      movePoint(eliminated_[i].step(of_states), PointBasis::of(point.bearing), point);
    }
    for (const std::uint8_t slot : order) {
      WindowState& state = states[slot];
      Vector15d delta = Vector15d::Zero();
      delta.head(state.dimension()) = step_.segment(state.offset, state.dimension());
      state.x.retract(delta);
    }
  }
  placeCameras();
  return true;
}

WindowValues BenchmarkWindow::values() const {
  WindowValues result;
  for (const std::uint8_t slot : order) result.states.push_back(states[slot].x);
  for (const Landmark& landmark : landmarks) result.points.push_back(landmark.point);
  return result;
}

void BenchmarkWindow::setValues(const WindowValues& values) {
  for (std::size_t k = 0; k < order.size(); ++k) states[order[k]].x = values.states[k];
  for (std::size_t i = 0; i < landmarks.size(); ++i) landmarks[i].point = values.points[i];
}

double BenchmarkWindow::cost() {
  placeCameras();
  double sum = 0.5 * (prior_root * priorDeviation() + prior_residual).squaredNorm();
  for (std::size_t k = kPoses + 1; k < order.size(); ++k) {
    MotionFactor factor;
    if (motionFactor(k, factor)) sum += 0.5 * factor.residual.squaredNorm();
  }
  for (const Landmark& landmark : landmarks) {
    for (const Sighting& sighting : landmark.sightings) {
      for (std::size_t c = 0; c < rig.camera_count; ++c) {
        Eigen::Vector2d r;
        if (!sighting.camera[c].used) continue;
        if (!reprojectionResidual(sighting.camera[c], poses_[sighting.slot].current[c], landmark.point, r)) {
          continue;
        }
        sum += RobustWeight::cauchy(r.squaredNorm()).cost;
      }
    }
  }
  return sum;
}

}  // namespace swiftlet::test
