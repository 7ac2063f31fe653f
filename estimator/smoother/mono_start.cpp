#include "estimator/smoother/mono_start.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <bitset>
#include <cmath>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/landmark_block.hpp"
#include "estimator/smoother/point_system.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kLeastFrames = 4;
constexpr std::size_t kLeastTracks = 15;
constexpr int kBiasIterations = 5;
constexpr int kLinearIterations = 6;
constexpr int kIterations = 12;
constexpr int kPointIterations = 6;
// What the model leaves out (the IMU's own noise, scale and axes; vibration) costs so much scale on
// the real logs however long the start; the covariance is raised to show it.
constexpr double kLeastScaleSigma = 0.04;
constexpr double kOutlier = 3.0;        // sigma: a track's RMS beyond it is left out
constexpr double kLeastParallax = 8.0;  // bearing sigmas
constexpr double kFirstSpeed = 1.0;     // m/s, for the first weights of the linear solve
constexpr double kConverged = 1e-6;     // relative decrease of the cost
// Noise puts some far points at infinity; more than this share means a mirrored path.
constexpr double kMostBehind = 0.25;
// First guesses, as multiples of the linear solution's velocity, tried until one fits.
constexpr std::array<double, 4> kVelocityGuesses{1.0, -1.0, 3.0, -3.0};
constexpr double kGoodFit = 1.5;      // residual RMS, whitened
constexpr double kUselessTilt = 0.5;  // rad

using Matrix11d = StartParameters::Matrix;
using Vector11d = StartParameters::Vector;
using Row11d = Eigen::Matrix<double, 1, StartParameters::kSize>;
using Matrix3x11d = Eigen::Matrix<double, 3, StartParameters::kSize>;

// The camera of one frame in the axes of image 0's body.
struct StartCamera {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  Matrix3x11d d_c = Matrix3x11d::Zero();
  Eigen::Matrix3d d_phi = Eigen::Matrix3d::Zero();  // right error of R by the gyro bias
  double variance = 0;                              // m^2 per axis, of the preintegrated position
  Eigen::Matrix<double, kPoseDim, StartParameters::kSize> d_pose =
      Eigen::Matrix<double, kPoseDim, StartParameters::kSize>::Zero();  // of the body
};

struct Cameras {
  FixedVector<StartCamera, kMaxMonoFrames> of_frame;
  std::array<RigPose, kMaxMonoFrames> poses;

  const StartCamera& operator[](std::size_t k) const { return of_frame[k]; }
};

struct Problem {
  std::span<const Preintegration> from_first;
  std::span<const BearingTrack> tracks;
  const std::array<SE3, kMaxCameras>& T_body_cam;
  double sigma;
  double gravity;
  std::bitset<kMaxMonoTracks> rejected;

  [[nodiscard]] std::size_t frames() const { return from_first.size() + 1; }
  // Frames of an epipolar pair lie a third of the start apart: parallax, and still many tracks.
  [[nodiscard]] std::size_t stride() const { return std::max<std::size_t>(1, from_first.size() / 3); }
};

bool seenIn(const BearingTrack& track, std::size_t frame) { return ((track.seen >> frame) & 1U) != 0; }

void makeCameras(const Problem& problem, const StartParameters& x, Cameras& cameras) {
  const Eigen::Matrix3d R_body_cam = problem.T_body_cam[0].R();
  const Eigen::Vector3d& lever = problem.T_body_cam[0].translation;
  cameras.of_frame.clear();
  for (std::size_t k = 0; k < problem.frames(); ++k) {
    SE3 T;
    StartCamera camera;
    if (k > 0) {
      const Preintegration& imu = problem.from_first[k - 1];
      const StartPose pose = x.poseAt(imu, problem.gravity);
      T = SE3(pose.rotation, pose.position);
      camera.d_pose.block<3, 3>(0, StartParameters::kBiasGyro) = pose.d_rotation;
      camera.d_pose.bottomRows<3>() = pose.d_position;
      camera.variance = imu.covariance().block<3, 3>(3, 3).trace() / 3.0;
    }
    camera.R = T.R() * R_body_cam;
    camera.c = T * lever;
    camera.d_c = camera.d_pose.bottomRows<3>() - T.R() * hat(lever) * camera.d_pose.topRows<3>();
    camera.d_phi = R_body_cam.transpose() * camera.d_pose.block<3, 3>(0, StartParameters::kBiasGyro);
    cameras.of_frame.pushBack(camera);
    cameras.poses[k].current[0] = cameras.poses[k].linearization[0] =
        CameraPose::of(T, problem.T_body_cam[0]);
  }
}

double weightOf(double whitened) { return RobustWeight::cauchy(whitened * whitened, 1.0).weight; }

// ---- Gyro bias by the eigenvalue method.

// Adds one frame pair's normal equations by the gyro bias, the translation direction eliminated.
void addBiasPair(const Problem& problem, const StartCamera& a, const StartCamera& b, std::size_t i,
                 std::size_t j, Eigen::Matrix3d& H, Eigen::Vector3d& g) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  std::size_t count = 0;
  for (const BearingTrack& track : problem.tracks) {
    if (!seenIn(track, i) || !seenIn(track, j)) continue;
    const Eigen::Vector3d n = (a.R * track.bearing[i]).cross(b.R * track.bearing[j]);
    M += n * n.transpose();
    ++count;
  }
  if (count < kLeastTracks) return;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(M);
  const Eigen::Vector3d t = eigen.eigenvectors().col(0);
  const Eigen::Matrix<double, 3, 2> T = eigen.eigenvectors().rightCols<2>();
  Eigen::Matrix<double, 3, 2> Hbt = Eigen::Matrix<double, 3, 2>::Zero();
  Eigen::Matrix2d Htt = Eigen::Matrix2d::Zero();
  Eigen::Vector2d gt = Eigen::Vector2d::Zero();
  Eigen::Matrix3d Hbb = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gb = Eigen::Vector3d::Zero();
  for (const BearingTrack& track : problem.tracks) {
    if (!seenIn(track, i) || !seenIn(track, j)) continue;
    const Eigen::Vector3d f = a.R * track.bearing[i];
    const Eigen::Vector3d h = b.R * track.bearing[j];
    const Eigen::Vector3d n = f.cross(h);
    const double sigma =
        problem.sigma * std::sqrt(t.cross(f).squaredNorm() + t.cross(h).squaredNorm() + 1e-6);
    const double r = n.dot(t) / sigma;
    const double w = weightOf(r);
    const Eigen::Matrix3d d_f = -a.R * hat(track.bearing[i]) * a.d_phi;
    const Eigen::Matrix3d d_h = -b.R * hat(track.bearing[j]) * b.d_phi;
    const Eigen::Vector3d Jb = (hat(f) * d_h - hat(h) * d_f).transpose() * t / sigma;
    const Eigen::Vector2d Jt = T.transpose() * n / sigma;
    Hbb += w * Jb * Jb.transpose();
    Hbt += w * Jb * Jt.transpose();
    Htt += w * Jt * Jt.transpose();
    gb += w * r * Jb;
    gt += w * r * Jt;
  }
  Htt.diagonal().array() += 1.0;  // the direction is a unit vector: a prior of one radian
  const Eigen::Matrix2d inverse = Htt.inverse();
  H += Hbb - Hbt * inverse * Hbt.transpose();
  g += gb - Hbt * inverse * gt;
}

Status gyroBias(const Problem& problem, const StartPrior& prior, Eigen::Vector3d& bias) {
  bias = prior.bias_gyro;
  const double weight = 1.0 / (prior.bias_gyro_sigma * prior.bias_gyro_sigma);
  for (int iteration = 0; iteration < kBiasIterations; ++iteration) {
    StartPrior at = prior;
    at.bias_gyro = bias;
    Cameras cameras;
    makeCameras(problem, StartParameters(Eigen::Vector3d::UnitZ(), at), cameras);
    Eigen::Matrix3d H = weight * Eigen::Matrix3d::Identity();
    Eigen::Vector3d g = weight * (bias - prior.bias_gyro);
    for (std::size_t i = 0; i + problem.stride() < problem.frames(); ++i) {
      const std::size_t j = i + problem.stride();
      addBiasPair(problem, cameras[i], cameras[j], i, j, H, g);
    }
    const Eigen::Vector3d step = -H.llt().solve(g);
    if (!step.allFinite()) return {StatusCode::kNumerical, "gyro bias iteration diverged"};
    bias += step;
    if (step.norm() < 1e-6) break;
  }
  return okStatus();
}

// ---- Velocity and tilt, linear and structureless.

Status linearSolve(const Problem& problem, const TiltEstimate& tilt, const StartPrior& prior,
                   StartParameters& x) {
  constexpr int kSolved = StartParameters::kTilt + 2;  // v and tilt; biases stay
  for (int iteration = 0; iteration < kLinearIterations; ++iteration) {
    Cameras cameras;
    makeCameras(problem, x, cameras);
    Matrix11d H = Matrix11d::Zero();
    Vector11d g = Vector11d::Zero();
    x.addPrior(tilt, prior, H, g);
    for (std::size_t s = 1; s <= 2; ++s) {
      for (std::size_t i = 0; i + s * problem.stride() < problem.frames(); ++i) {
        const std::size_t j = i + s * problem.stride();
        const StartCamera& a = cameras[i];
        const StartCamera& b = cameras[j];
        const Eigen::Vector3d d = b.c - a.c;
        const double span = static_cast<double>(j - i) * problem.from_first.back().duration() /
                            static_cast<double>(problem.from_first.size());
        for (const BearingTrack& track : problem.tracks) {
          if (!seenIn(track, i) || !seenIn(track, j)) continue;
          const Eigen::Vector3d f = a.R * track.bearing[i];
          const Eigen::Vector3d h = b.R * track.bearing[j];
          const Eigen::Vector3d n = f.cross(h);
          const double reach = iteration == 0
                                   ? kFirstSpeed * span
                                   : std::sqrt(d.cross(f).squaredNorm() + d.cross(h).squaredNorm()) + 1e-3;
          const double r = n.dot(d) / (problem.sigma * reach);
          const double w = iteration < 2 ? 1.0 : weightOf(r);
          const Row11d J = n.transpose() * (b.d_c - a.d_c) / (problem.sigma * reach);
          H += w * J.transpose() * J;
          g += w * r * J.transpose();
        }
      }
    }
    const Eigen::Matrix<double, kSolved, kSolved> A = H.topLeftCorner<kSolved, kSolved>();
    const Eigen::LLT<Eigen::Matrix<double, kSolved, kSolved>> llt(A);
    if (llt.info() != Eigen::Success) return {StatusCode::kDegenerate, "start equations are singular"};
    Vector11d step = Vector11d::Zero();
    step.head<kSolved>() = -llt.solve(g.head<kSolved>());
    if (!step.allFinite()) return {StatusCode::kNumerical, "linear start diverged"};
    x.retract(step);
  }
  return okStatus();
}

// ---- Refinement: reprojection errors, each point eliminated.

struct Normal {
  Matrix11d H = Matrix11d::Zero();
  Vector11d g = Vector11d::Zero();
  double cost = 0;  // half the sum of whitened squares, robust
  double squares = 0;
  int rows = 0;
  int tracks = 0;
  int behind = 0;  // tracks without a point in front of their cameras

  // n . d = 0 does not know the sign of d: a mirrored path puts the points behind the cameras.
  [[nodiscard]] double shareBehind() const { return tracks > 0 ? static_cast<double>(behind) / tracks : 0.0; }
};

using TrackSightings = FixedVector<Sighting, kMaxMonoFrames>;

// `inverse_depth`: of the point; the nearer it is, the more the IMU's noise in the position counts.
void weighSightings(const Problem& problem, const Cameras& cameras, double inverse_depth,
                    TrackSightings& sightings) {
  for (Sighting& sighting : sightings) {
    CameraSighting& view = sighting.camera[0];
    const PointBasis basis = PointBasis::of(view.ray());
    const double moved = inverse_depth * inverse_depth * cameras[sighting.slot].variance;
    const double sigma = std::sqrt(problem.sigma * problem.sigma + moved);
    Matrix23d W;
    W << basis.b1.transpose() / sigma, basis.b2.transpose() / sigma;
    view = CameraSighting::of(view.ray(), W);
  }
}

// The point that fits the track best with the cameras as they are; at infinity where none is in front of
// them.
LandmarkPoint pointOf(const Problem& problem, const Cameras& cameras, const BearingTrack& track,
                      TrackSightings& sightings) {
  sightings.clear();
  for (std::size_t k = 0; k < problem.frames(); ++k) {
    if (!seenIn(track, k)) continue;
    Sighting sighting;
    sighting.slot = static_cast<std::uint32_t>(k);
    sighting.camera[0] = CameraSighting::of(track.bearing[k], Matrix23d::Zero());
    sightings.pushBack(sighting);
  }
  const std::span<const Sighting> views{sightings.data(), sightings.size()};
  LandmarkPoint point;
  weighSightings(problem, cameras, 0, sightings);
  bool found = triangulate(cameras.poses, views, kPointIterations, point);
  weighSightings(problem, cameras, point.inverse_depth, sightings);
  found = found && triangulate(cameras.poses, views, kPointIterations, point);
  if (found) return point;
  const Sighting& first = sightings.front();
  point = {};
  point.reference = cameras[first.slot].c;
  point.bearing = cameras[first.slot].R * first.camera[0].ray();
  return point;
}

// Information and gradient of one frame's pose, before any point is eliminated.
struct PoseSums {
  Eigen::Matrix<double, kPoseDim, kPoseDim> H = Eigen::Matrix<double, kPoseDim, kPoseDim>::Zero();
  Eigen::Matrix<double, kPoseDim, 1> g = Eigen::Matrix<double, kPoseDim, 1>::Zero();
};

// Linearizes all tracks; `reject`: leaves out those that fit badly from now on.
Normal linearize(Problem& problem, LandmarkBlock& landmark, const StartParameters& x,
                 const TiltEstimate& tilt, const StartPrior& prior, bool reject) {
  Cameras cameras;
  makeCameras(problem, x, cameras);
  Normal normal;
  std::array<PoseSums, kMaxMonoFrames> sums;
  TrackSightings sightings;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    if (problem.rejected[t]) continue;
    const LandmarkPoint point = pointOf(problem, cameras, problem.tracks[t], sightings);
    const std::span<const Sighting> views{sightings.data(), sightings.size()};
    const int rows = std::max(1, 2 * static_cast<int>(views.size()) - 3);
    const double squares =
        static_cast<double>(views.size()) * meanSquaredResidual(cameras.poses, views, point);
    if (reject && squares > kOutlier * kOutlier * rows) {
      problem.rejected.set(t);
      continue;
    }
    landmark.linearize({views, cameras.poses, problem.T_body_cam, {}}, point);
    if (!landmark.eliminate()) continue;
    // With D = d pose / d x the reduced blocks A_i - Y_i Y_i^T and -Y_i Y_j^T are in x
    // sum D_i^T A_i D_i - U U^T, U = sum D_i^T Y_i.
    Eigen::Matrix<double, StartParameters::kSize, 3> U =
        Eigen::Matrix<double, StartParameters::kSize, 3>::Zero();
    for (const LandmarkBlock::State& state : landmark.states()) {
      using Columns = Eigen::Matrix<double, kPaddedRows, kPoseDim>;
      using PointColumns = Eigen::Matrix<double, kPaddedRows, 3>;
      const auto A = Eigen::Map<const Columns>(state.information.column[0]).topRows<kPoseDim>();
      const auto Y = Eigen::Map<const PointColumns>(state.point[0]).topRows<kPoseDim>();
      PoseSums& sum = sums[state.slot];
      sum.H += Y * Y.transpose();
      sum.H += A.selfadjointView<Eigen::Lower>();
      sum.g += Eigen::Map<const Eigen::Matrix<double, kPoseDim, 1>>(state.gradient);
      U += cameras[state.slot].d_pose.transpose() * Y;
    }
    normal.H -= U * U.transpose();
    normal.cost += landmark.cost();
    normal.squares += squares;
    normal.rows += rows;
    ++normal.tracks;
    normal.behind += point.inverse_depth > 0 ? 0 : 1;
  }
  for (std::size_t k = 1; k < problem.frames(); ++k) {
    const auto& D = cameras[k].d_pose;
    normal.H += D.transpose() * sums[k].H * D;
    normal.g += D.transpose() * sums[k].g;
  }
  x.addPrior(tilt, prior, normal.H, normal.g);
  normal.cost += 0.5 * x.priorCost(tilt, prior);
  return normal;
}

// Levenberg-Marquardt; `normal` is left linearized at the final x.
bool refine(Problem& problem, LandmarkBlock& landmark, const TiltEstimate& tilt, const StartPrior& prior,
            StartParameters& x, Normal& normal) {
  double lambda = 1e-3;
  normal = linearize(problem, landmark, x, tilt, prior, false);
  bool converged = false;
  for (int iteration = 0; iteration < kIterations && !converged; ++iteration) {
    Matrix11d damped = normal.H;
    damped.diagonal() *= 1.0 + lambda;
    const Vector11d step = -damped.llt().solve(normal.g);
    if (!step.allFinite()) return false;
    StartParameters moved = x;
    moved.retract(step);
    const Normal next = linearize(problem, landmark, moved, tilt, prior, false);
    if (next.cost <= normal.cost) {
      converged = normal.cost - next.cost < kConverged * normal.cost;
      x = moved;
      normal = next;
      lambda = std::max(0.1 * lambda, 1e-9);
    } else {
      converged = step.norm() < kConverged;
      lambda *= 10;
    }
  }
  return true;
}

// The refinement from several first guesses; the best fit with its points before the cameras.
bool refineBest(Problem& problem, LandmarkBlock& landmark, const TiltEstimate& tilt, const StartPrior& prior,
                StartParameters& x, Normal& normal) {
  const StartParameters linear = x;
  bool found = false;
  for (const double factor : kVelocityGuesses) {
    StartParameters guess = linear;
    Vector11d change = Vector11d::Zero();
    change.segment<3>(StartParameters::kVelocity) = (factor - 1.0) * linear.velocity();
    guess.retract(change);
    if (factor != 1.0) guess.setUp(tilt.up);
    Normal at;
    if (!refine(problem, landmark, tilt, prior, guess, at) || at.shareBehind() > kMostBehind) continue;
    if (!found || at.cost < normal.cost) {
      x = guess;
      normal = at;
    }
    found = true;
    if (normal.squares < kGoodFit * kGoodFit * normal.rows) break;
  }
  return found;
}

double medianParallax(const Problem& problem, const Cameras& cameras) {
  std::array<double, kMaxMonoTracks> angles{};
  std::size_t count = 0;
  for (const BearingTrack& track : problem.tracks) {
    if (track.seen == 0) continue;
    std::size_t first = 0;
    while (!seenIn(track, first)) ++first;
    const Eigen::Vector3d f = cameras[first].R * track.bearing[first];
    double largest = 0;
    for (std::size_t k = first + 1; k < problem.frames(); ++k) {
      if (seenIn(track, k)) largest = std::max(largest, f.cross(cameras[k].R * track.bearing[k]).norm());
    }
    angles[count++] = largest;
  }
  if (count == 0) return 0;
  const auto middle = angles.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(angles.begin(), middle, angles.begin() + static_cast<std::ptrdiff_t>(count));
  return *middle;
}

// Sigma of s in path -> (1 + s) path: the part of an error that is along the path itself.
double scaleSigma(const Cameras& cameras, const Matrix11d& covariance) {
  Row11d along = Row11d::Zero();
  double squares = 0;
  for (std::size_t k = 1; k < cameras.of_frame.size(); ++k) {
    const Eigen::Vector3d path = cameras[k].c - cameras[0].c;
    along += path.transpose() * cameras[k].d_c;
    squares += path.squaredNorm();
  }
  if (squares <= 0) return 1e9;
  along /= squares;
  return std::sqrt((along * covariance * along.transpose()).value());
}

}  // namespace

MonoStartSolver::MonoStartSolver() : landmark_(std::make_unique<LandmarkBlock>(kMaxMonoFrames)) {}

MonoStartSolver::~MonoStartSolver() = default;

Status MonoStartSolver::solve(std::span<const Preintegration> from_first,
                              std::span<const BearingTrack> tracks, const SE3& T_body_cam,
                              double bearing_sigma, const TiltEstimate& tilt, const ImuNoise& noise,
                              const StartPrior& prior, MonoStart& start) {
  start = MonoStart{};
  if (from_first.size() + 1 < kLeastFrames || tracks.size() < kLeastTracks) {
    return {StatusCode::kNotReady, "fewer than 4 frames or 15 tracks"};
  }
  const std::array<SE3, kMaxCameras> mounted{T_body_cam, T_body_cam};
  Problem problem{from_first.first(std::min(from_first.size(), kMaxMonoFrames - 1)),
                  tracks.first(std::min(tracks.size(), kMaxMonoTracks)),
                  mounted,
                  bearing_sigma,
                  noise.gravity,
                  {}};
  // Sightings beyond the frames in use do not count; one sighting says nothing.
  const std::uint32_t mask = (1U << problem.frames()) - 1U;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    if (std::popcount(problem.tracks[t].seen & mask) < 2) problem.rejected.set(t);
  }
  StartPrior guess = prior;
  if (const Status status = gyroBias(problem, prior, guess.bias_gyro); !status.ok()) return status;
  StartParameters x(tilt.up, guess);
  Cameras cameras;
  makeCameras(problem, x, cameras);
  start.parallax = medianParallax(problem, cameras);
  if (start.parallax < kLeastParallax * bearing_sigma) return {StatusCode::kDegenerate, "no parallax yet"};
  if (const Status status = linearSolve(problem, tilt, guess, x); !status.ok()) return status;

  Normal normal;
  if (!refineBest(problem, *landmark_, tilt, prior, x, normal)) {
    return {StatusCode::kDegenerate, "no path fits the bearings with points before the camera"};
  }
  linearize(problem, *landmark_, x, tilt, prior, true);
  if (problem.rejected.any() && !refine(problem, *landmark_, tilt, prior, x, normal)) {
    return {StatusCode::kNumerical, "mono start diverged"};
  }
  if (normal.shareBehind() > kMostBehind) return {StatusCode::kDegenerate, "points behind the camera"};

  start.tracks = static_cast<int>(problem.tracks.size() - problem.rejected.count());
  if (start.tracks < static_cast<int>(kLeastTracks)) return {StatusCode::kDegenerate, "too few tracks agree"};
  const Eigen::LLT<Matrix11d> llt(normal.H);
  if (llt.info() != Eigen::Success) return {StatusCode::kDegenerate, "start equations are singular"};
  Matrix11d covariance = llt.solve(Matrix11d::Identity());
  start.motion.residual_rms = std::sqrt(normal.squares / std::max(1, normal.rows));
  // Residuals larger than their sigma: the bearings' noise was given too small.
  const double excess = std::max(1.0, start.motion.residual_rms);
  covariance *= excess * excess;
  makeCameras(problem, x, cameras);
  const double scale_sigma = scaleSigma(cameras, covariance);
  start.scale_sigma = std::hypot(scale_sigma, kLeastScaleSigma);
  covariance *= std::pow(start.scale_sigma / std::max(scale_sigma, 1e-6), 2);
  const double rms = start.motion.residual_rms;
  x.toMotionStart(covariance, start.motion);
  start.motion.residual_rms = rms;
  if (!(start.motion.tilt_sigma < kUselessTilt))
    return {StatusCode::kDegenerate, "motion does not show gravity"};
  return okStatus();
}

}  // namespace swiftlet
