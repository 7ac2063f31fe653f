#include "estimator/imu/mono_start.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <bitset>
#include <cmath>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/imu/start_parameters.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kLeastFrames = 4;
constexpr std::size_t kLeastTracks = 15;
constexpr int kBiasIterations = 5;
constexpr int kLinearIterations = 6;
constexpr int kIterations = 12;
constexpr int kPointIterations = 2;
// Each bearing is used in two pairs (twice the information), and the noise of the planes is not that of a
// linear model: on simulated flights, errors are up to twice what would remain.
constexpr double kBiasInflation = 8.0;  // on the variance
// What the model omits (the IMU's own noise, scale and axes; vibration) limits the accuracy of the scale on
// real logs, however long the start is; the covariance is increased accordingly.
constexpr double kLeastScaleSigma = 0.04;
constexpr double kHuber = 2.0;             // sigma
constexpr double kOutlier = 3.0;           // sigma: tracks with a larger RMS are rejected
constexpr double kLeastParallax = 8.0;     // bearing sigmas
constexpr double kInverseDepthPrior = 10;  // 1/m, about 0; only keeps points without parallax finite
constexpr double kFirstSpeed = 1.0;        // m/s, for the first weights of the linear solve
constexpr double kConverged = 1e-6;        // relative decrease of the cost
// Noise puts some far points behind the camera; a larger share than this means a mirrored path.
constexpr double kMostBehind = 0.25;
// Initial guesses, as multiples of the linear solution's velocity, tried until one fits.
constexpr std::array<double, 4> kVelocityGuesses{1.0, -1.0, 3.0, -3.0};
constexpr double kGoodFit = 1.5;      // residual RMS, whitened
constexpr double kUselessTilt = 0.5;  // rad

using Matrix11d = StartParameters::Matrix;
using Vector11d = StartParameters::Vector;
using Row11d = Eigen::Matrix<double, 1, StartParameters::kSize>;

// Camera of one frame in the axes of image 0's body.
struct CameraPose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, StartParameters::kSize> d_c =
      Eigen::Matrix<double, 3, StartParameters::kSize>::Zero();
  Eigen::Matrix3d d_phi = Eigen::Matrix3d::Zero();  // right error of R per gyro bias
  double variance = 0;                              // m^2 per axis, of the preintegrated position
};
using Cameras = FixedVector<CameraPose, kMaxMonoFrames>;

struct Problem {
  std::span<const Preintegration> from_first;
  std::span<const BearingTrack> tracks;
  const SE3& T_body_cam;
  double sigma;
  double gravity;
  std::bitset<kMaxMonoTracks> rejected;

  [[nodiscard]] std::size_t frames() const { return from_first.size() + 1; }
  // Frames of an epipolar pair are a third of the start apart, for parallax with still many common tracks.
  [[nodiscard]] std::size_t stride() const { return std::max<std::size_t>(1, from_first.size() / 3); }
};

bool seenIn(const BearingTrack& track, std::size_t frame) { return ((track.seen >> frame) & 1U) != 0; }

void makeCameras(const Problem& problem, const StartParameters& x, Cameras& cameras) {
  const Eigen::Matrix3d R_body_cam = problem.T_body_cam.R();
  const Eigen::Vector3d& lever = problem.T_body_cam.translation;
  cameras.clear();
  CameraPose first;
  first.R = R_body_cam;
  first.c = lever;
  (void)cameras.tryPushBack(first);
  for (const Preintegration& imu : problem.from_first) {
    const StartPose pose = x.poseAt(imu, problem.gravity);
    const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
    CameraPose camera;
    camera.R = R * R_body_cam;
    camera.c = pose.position + R * lever;
    camera.d_c = pose.d_position;
    camera.d_c.middleCols<3>(StartParameters::kBiasGyro) -= R * hat(lever) * pose.d_rotation;
    camera.d_phi = R_body_cam.transpose() * pose.d_rotation;
    camera.variance = imu.covariance().block<3, 3>(3, 3).trace() / 3.0;
    (void)cameras.tryPushBack(camera);
  }
}

Eigen::Matrix<double, 3, 2> tangent(const Eigen::Vector3d& f) {
  const Eigen::Vector3d other = std::abs(f.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> B;
  B.col(0) = f.cross(other).normalized();
  B.col(1) = f.cross(B.col(0));
  return B;
}

double huberWeight(double whitened) { return whitened <= kHuber ? 1.0 : kHuber / whitened; }
double huberCost(double whitened) {
  return whitened <= kHuber ? whitened * whitened : kHuber * (2.0 * whitened - kHuber);
}

// ---- Gyro bias with the eigenvalue method.

// Adds the normal equations of one frame pair for the gyro bias, with the translation direction eliminated.
void addBiasPair(const Problem& problem, const CameraPose& a, const CameraPose& b, std::size_t i,
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
    const double w = huberWeight(std::abs(r));
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

Status gyroBias(const Problem& problem, const StartPrior& prior, Eigen::Vector3d& bias, double& sigma) {
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
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
    eigen.computeDirect(H, Eigen::EigenvaluesOnly);
    sigma = std::sqrt(kBiasInflation / eigen.eigenvalues()[0]);
    if (step.norm() < 1e-6) break;
  }
  sigma = std::min(sigma, prior.bias_gyro_sigma);
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
        const CameraPose& a = cameras[i];
        const CameraPose& b = cameras[j];
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
          const double w = iteration < 2 ? 1.0 : huberWeight(std::abs(r));
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

// ---- Refinement: reprojection errors with each point eliminated.

struct TrackPoint {
  std::size_t anchor = 0;
  Eigen::Vector3d direction;  // unit, anchor camera's axes
  double inverse_depth = 0;   // 1/m
};

struct Sighting {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 3> d_point;  // direction (2, tangent), inverse depth
  Eigen::Matrix<double, 2, StartParameters::kSize> d_x;
  double norm = 0;  // whitened
};

// `with_x` false: only the derivatives by the point.
Sighting sight(const Problem& problem, const Cameras& cameras, const TrackPoint& point,
               const Eigen::Matrix<double, 3, 2>& B, const Eigen::Vector3d& bearing, std::size_t k,
               bool with_x) {
  const CameraPose& anchor = cameras[point.anchor];
  const CameraPose& camera = cameras[k];
  const Eigen::Vector3d base = anchor.c - camera.c;
  const Eigen::Matrix3d Rt = camera.R.transpose();
  const Eigen::Matrix3d R_rel = Rt * anchor.R;
  const Eigen::Vector3d y = R_rel * point.direction + point.inverse_depth * (Rt * base);
  const double length = std::max(y.norm(), 1e-9);
  const Eigen::Vector3d unit = y / length;
  const double rho = point.inverse_depth;
  const double sigma = std::sqrt(problem.sigma * problem.sigma + rho * rho * camera.variance);
  const Eigen::Matrix<double, 2, 3> P = tangent(bearing).transpose() / sigma;
  const Eigen::Matrix<double, 2, 3> D = P * (Eigen::Matrix3d::Identity() - unit * unit.transpose()) / length;
  Sighting s;
  s.residual = P * unit;
  s.norm = s.residual.norm();
  s.d_point.leftCols<2>() = D * R_rel * B;
  s.d_point.col(2) = D * (Rt * base);
  if (!with_x) return s;
  s.d_x = rho * D * Rt * (anchor.d_c - camera.d_c);
  s.d_x.middleCols<3>(StartParameters::kBiasGyro) +=
      D * (hat(y) * camera.d_phi - R_rel * hat(point.direction) * anchor.d_phi);
  return s;
}

// The point that fits the track best for the current cameras.
TrackPoint triangulate(const Problem& problem, const Cameras& cameras, const BearingTrack& track) {
  TrackPoint point;
  while (!seenIn(track, point.anchor)) ++point.anchor;
  point.direction = track.bearing[point.anchor];
  for (int iteration = 0; iteration < kPointIterations; ++iteration) {
    const Eigen::Matrix<double, 3, 2> B = tangent(point.direction);
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    H(2, 2) = 1.0 / (kInverseDepthPrior * kInverseDepthPrior);
    Eigen::Vector3d g(0, 0, H(2, 2) * point.inverse_depth);
    for (std::size_t k = point.anchor; k < problem.frames(); ++k) {
      if (!seenIn(track, k)) continue;
      const Sighting s = sight(problem, cameras, point, B, track.bearing[k], k, false);
      const double w = huberWeight(s.norm);
      H += w * s.d_point.transpose() * s.d_point;
      g += w * s.d_point.transpose() * s.residual;
    }
    const Eigen::Vector3d step = -H.llt().solve(g);
    if (!step.allFinite()) break;
    point.direction = (point.direction + B * step.head<2>()).normalized();
    point.inverse_depth += step.z();
  }
  return point;
}

struct Normal {
  Matrix11d H = Matrix11d::Zero();
  Vector11d g = Vector11d::Zero();
  double cost = 0;
  double squares = 0;
  int rows = 0;
  int tracks = 0;
  int behind = 0;  // tracks whose point is behind its camera

  // n . d = 0 does not determine the sign of d: on a mirrored path the points are behind the cameras.
  [[nodiscard]] double shareBehind() const { return tracks > 0 ? static_cast<double>(behind) / tracks : 0.0; }
};

void addTrack(const Problem& problem, const Cameras& cameras, const BearingTrack& track, Normal& normal,
              double& mean_square) {
  const TrackPoint point = triangulate(problem, cameras, track);
  const Eigen::Matrix<double, 3, 2> B = tangent(point.direction);
  Eigen::Matrix3d Hpp = Eigen::Matrix3d::Zero();
  Hpp(2, 2) = 1.0 / (kInverseDepthPrior * kInverseDepthPrior);
  Eigen::Vector3d gp(0, 0, Hpp(2, 2) * point.inverse_depth);
  Eigen::Matrix<double, StartParameters::kSize, 3> Hxp =
      Eigen::Matrix<double, StartParameters::kSize, 3>::Zero();
  double squares = 0;
  int sightings = 0;
  for (std::size_t k = point.anchor; k < problem.frames(); ++k) {
    if (!seenIn(track, k)) continue;
    const Sighting s = sight(problem, cameras, point, B, track.bearing[k], k, true);
    const double w = huberWeight(s.norm);
    Hpp += w * s.d_point.transpose() * s.d_point;
    gp += w * s.d_point.transpose() * s.residual;
    Hxp += w * s.d_x.transpose() * s.d_point;
    normal.H += w * s.d_x.transpose() * s.d_x;
    normal.g += w * s.d_x.transpose() * s.residual;
    normal.cost += huberCost(s.norm);
    squares += s.norm * s.norm;
    ++sightings;
  }
  const Eigen::Matrix3d inverse = Hpp.inverse();
  normal.H -= Hxp * inverse * Hxp.transpose();
  normal.g -= Hxp * inverse * gp;
  ++normal.tracks;
  normal.behind += point.inverse_depth < 0 ? 1 : 0;
  normal.squares += squares;
  normal.rows += 2 * sightings - 3;
  mean_square = squares / std::max(1, 2 * sightings - 3);
}

// Linearizes all tracks. `reject`: excludes tracks that fit badly from now on.
Normal linearize(Problem& problem, const StartParameters& x, const TiltEstimate& tilt,
                 const StartPrior& prior, bool reject) {
  Cameras cameras;
  makeCameras(problem, x, cameras);
  Normal normal;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    if (problem.rejected[t]) continue;
    Normal with = normal;
    double mean_square = 0;
    addTrack(problem, cameras, problem.tracks[t], with, mean_square);
    if (reject && mean_square > kOutlier * kOutlier) {
      problem.rejected.set(t);
    } else {
      normal = with;
    }
  }
  Matrix11d prior_H = Matrix11d::Zero();
  Vector11d prior_g = Vector11d::Zero();
  x.addPrior(tilt, prior, prior_H, prior_g);
  normal.H += prior_H;
  normal.g += prior_g;
  normal.cost += x.priorCost(tilt, prior);
  return normal;
}

// Levenberg-Marquardt; `normal` is linearized at the final x.
bool refine(Problem& problem, const TiltEstimate& tilt, const StartPrior& prior, StartParameters& x,
            Normal& normal) {
  double lambda = 1e-3;
  normal = linearize(problem, x, tilt, prior, false);
  bool converged = false;
  for (int iteration = 0; iteration < kIterations && !converged; ++iteration) {
    Matrix11d damped = normal.H;
    damped.diagonal() *= 1.0 + lambda;
    const Vector11d step = -damped.llt().solve(normal.g);
    if (!step.allFinite()) return false;
    StartParameters moved = x;
    moved.retract(step);
    const Normal next = linearize(problem, moved, tilt, prior, false);
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

// Refines from several initial guesses; selects the best fit with its points in front of the cameras.
bool refineBest(Problem& problem, const TiltEstimate& tilt, const StartPrior& prior, StartParameters& x,
                Normal& normal) {
  const StartParameters linear = x;
  bool found = false;
  for (const double factor : kVelocityGuesses) {
    StartParameters guess = linear;
    Vector11d change = Vector11d::Zero();
    change.segment<3>(StartParameters::kVelocity) = (factor - 1.0) * linear.velocity();
    guess.retract(change);
    if (factor != 1.0) guess.setUp(tilt.up);
    Normal at;
    if (!refine(problem, tilt, prior, guess, at) || at.shareBehind() > kMostBehind) continue;
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

// Sigma of s in path -> (1 + s) path, from the component of the error along the path.
double scaleSigma(const Cameras& cameras, const Matrix11d& covariance) {
  Row11d along = Row11d::Zero();
  double squares = 0;
  for (std::size_t k = 1; k < cameras.size(); ++k) {
    const Eigen::Vector3d path = cameras[k].c - cameras[0].c;
    along += path.transpose() * cameras[k].d_c;
    squares += path.squaredNorm();
  }
  if (squares <= 0) return 1e9;
  along /= squares;
  return std::sqrt((along * covariance * along.transpose()).value());
}

Problem makeProblem(std::span<const Preintegration> from_first, std::span<const BearingTrack> tracks,
                    const SE3& T_body_cam, double bearing_sigma, double gravity) {
  Problem problem{from_first.first(std::min(from_first.size(), kMaxMonoFrames - 1)),
                  tracks.first(std::min(tracks.size(), kMaxMonoTracks)),
                  T_body_cam,
                  bearing_sigma,
                  gravity,
                  {}};
  // Observations in frames that are not used do not count; a single observation gives no information.
  const std::uint32_t mask = (1U << problem.frames()) - 1U;
  for (std::size_t t = 0; t < problem.tracks.size(); ++t) {
    if (std::popcount(problem.tracks[t].seen & mask) < 2) problem.rejected.set(t);
  }
  return problem;
}

}  // namespace

Status solveGyroBias(std::span<const Preintegration> from_first, std::span<const BearingTrack> tracks,
                     const SE3& T_body_cam, double bearing_sigma, const StartPrior& prior,
                     Eigen::Vector3d& bias_gyro, double& sigma) {
  if (from_first.empty() || tracks.size() < kLeastTracks) {
    return {StatusCode::kNotReady, "fewer than 2 frames or 15 tracks"};
  }
  const Problem problem = makeProblem(from_first, tracks, T_body_cam, bearing_sigma, 0);
  return gyroBias(problem, prior, bias_gyro, sigma);
}

Status solveMonoStart(std::span<const Preintegration> from_first, std::span<const BearingTrack> tracks,
                      const SE3& T_body_cam, double bearing_sigma, const TiltEstimate& tilt,
                      const ImuNoise& noise, const StartPrior& prior, MonoStart& start) {
  start = MonoStart{};
  if (from_first.size() + 1 < kLeastFrames || tracks.size() < kLeastTracks) {
    return {StatusCode::kNotReady, "fewer than 4 frames or 15 tracks"};
  }
  Problem problem = makeProblem(from_first, tracks, T_body_cam, bearing_sigma, noise.gravity);
  StartPrior guess = prior;
  double bias_sigma = 0;
  if (const Status status = gyroBias(problem, prior, guess.bias_gyro, bias_sigma); !status.ok())
    return status;
  StartParameters x(tilt.up, guess);
  Cameras cameras;
  makeCameras(problem, x, cameras);
  start.parallax = medianParallax(problem, cameras);
  if (start.parallax < kLeastParallax * bearing_sigma) return {StatusCode::kDegenerate, "no parallax yet"};
  if (const Status status = linearSolve(problem, tilt, guess, x); !status.ok()) return status;

  Normal normal;
  if (!refineBest(problem, tilt, prior, x, normal)) {
    return {StatusCode::kDegenerate, "no path fits the bearings with points before the camera"};
  }
  linearize(problem, x, tilt, prior, true);
  if (problem.rejected.any() && !refine(problem, tilt, prior, x, normal)) {
    return {StatusCode::kNumerical, "mono start diverged"};
  }
  if (normal.shareBehind() > kMostBehind) return {StatusCode::kDegenerate, "points behind the camera"};

  start.tracks = static_cast<int>(problem.tracks.size() - problem.rejected.count());
  if (start.tracks < static_cast<int>(kLeastTracks)) return {StatusCode::kDegenerate, "too few tracks agree"};
  const Eigen::LLT<Matrix11d> llt(normal.H);
  if (llt.info() != Eigen::Success) return {StatusCode::kDegenerate, "start equations are singular"};
  Matrix11d covariance = llt.solve(Matrix11d::Identity());
  start.motion.residual_rms = std::sqrt(normal.squares / std::max(1, normal.rows));
  // Residuals larger than their sigma mean that the bearings' noise was given too small.
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
