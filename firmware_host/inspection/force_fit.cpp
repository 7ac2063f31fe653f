#include "firmware_host/inspection/force_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kWindow = 1.2;  // s; short, because accelerations must change and tracks survive
constexpr std::size_t kImagesOfWindow = 10;
constexpr std::size_t kFewestSightings = 5;
constexpr std::size_t kFewestOfWindow = 12;
// Least ratio of the second smallest error to the smallest for a window that determines its unknowns.
constexpr double kDistinct = 4;
constexpr double kLeastSquare = 1e-9;  // rad^2; no tracker is better than 0.01 px
// First columns of gravity, readings and lever arm.
constexpr int kGravityAt = 3;
constexpr int kReadingsAt = 6;
constexpr int kLeverAt = 15;

using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

}  // namespace

ForceFitter::ForceFitter(const std::vector<TrackedImage>& images, const std::vector<ImuSample>& samples,
                         const CameraModel& camera, const SE3& T_body_cam, Duration shift,
                         const Eigen::Vector3d& gyro_offset)
    : focal_(camera.focal()) {
  for (std::size_t first = 0; first < images.size();) {
    std::size_t last = first;
    while (last + 1 < images.size() && images[last + 1].follows &&
           (images[last].stamp - images[first].stamp).seconds() < kWindow) {
      ++last;
    }
    std::vector<const TrackedImage*> chosen;
    std::vector<Stamp> stamps;
    const std::size_t step = std::max<std::size_t>(1, (last - first + 1) / kImagesOfWindow);
    for (std::size_t i = first; i <= last; i += step) {
      chosen.push_back(&images[i]);
      stamps.push_back(images[i].stamp + shift);
    }
    const bool whole = (images[last].stamp - images[first].stamp).seconds() >= kWindow;
    first = last + 1;
    if (!whole) continue;
    const std::vector<BodyAt> bodies = integrate(samples, stamps, gyro_offset, T_body_cam.translation);
    if (bodies.size() == chosen.size()) addWindow(chosen, bodies, camera, T_body_cam.R());
  }
}

std::vector<ForceFitter::BodyAt> ForceFitter::integrate(const std::vector<ImuSample>& samples,
                                                        const std::vector<Stamp>& wanted,
                                                        const Eigen::Vector3d& offset,
                                                        const Eigen::Vector3d& lever) {
  std::vector<BodyAt> bodies;
  auto next = std::ranges::upper_bound(samples, wanted.front(), {}, &ImuSample::stamp);
  if (next == samples.begin()) return bodies;
  BodyAt body;
  Eigen::Matrix<double, 3, 9> velocity = Eigen::Matrix<double, 3, 9>::Zero();
  Stamp now = wanted.front();
  for (const Stamp stamp : wanted) {
    while (now < stamp) {
      if (next == samples.end()) return bodies;
      const Stamp until = std::min(stamp, next->stamp);
      const double dt = (until - now).seconds();
      const Eigen::Vector3d rate = next->gyro - offset;
      const Eigen::Matrix3d R = body.R * expSo3Matrix(0.5 * dt * rate);
      Eigen::Matrix<double, 3, 9> force;  // column 3 j + i: reading j along axis i
      for (int j = 0; j < 3; ++j) force.middleCols<3>(3 * j) = next->accel[j] * R;
      body.place.middleCols<9>(kReadingsAt) += velocity * dt + 0.5 * dt * dt * force;
      velocity += dt * force;
      body.R = body.R * expSo3Matrix(dt * rate);
      now = until;
      if (now == next->stamp) ++next;
    }
    const double t = (stamp - wanted.front()).seconds();
    body.place.leftCols<3>() = t * Eigen::Matrix3d::Identity();
    body.place.middleCols<3>(kGravityAt) = 0.5 * t * t * Eigen::Matrix3d::Identity();
    body.place.col(kLeverAt) = body.R * lever - lever;
    bodies.push_back(body);
  }
  return bodies;
}

void ForceFitter::addWindow(const std::vector<const TrackedImage*>& images, const std::vector<BodyAt>& bodies,
                            const CameraModel& camera, const Eigen::Matrix3d& R_body_cam) {
  struct Ray {
    std::size_t image;
    Eigen::Vector3d direction;
  };
  std::map<std::uint32_t, std::vector<Ray>> tracks;
  for (std::size_t j = 0; j < images.size(); ++j) {
    for (const TrackedPoint& seen : images[j]->points) {
      Eigen::Vector3d bearing;
      if (!camera.unproject(seen.pixel.cast<double>(), bearing)) continue;
      tracks[seen.track].push_back({j, bodies[j].R * (R_body_cam * bearing)});
    }
  }
  Window window;
  std::size_t used = 0;
  for (const auto& [track, rays] : tracks) {
    if (rays.size() < kFewestSightings) continue;
    // The point nearest to the rays, as a linear function of the unknowns.
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    Place pull = Place::Zero();
    const auto across = [](const Ray& ray) -> Eigen::Matrix3d {
      return Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    };
    for (const Ray& ray : rays) {
      sum += across(ray);
      pull += across(ray) * bodies[ray.image].place;
    }
    // Without parallax a point may be anywhere on its ray; this keeps it near.
    constexpr double kRegular = 1e-4;
    sum.diagonal().array() += kRegular;
    const Place point = sum.inverse() * pull;
    for (const Ray& ray : rays) {
      const Place from_camera = point - bodies[ray.image].place;
      const Place off = across(ray) * from_camera;
      window.error += off.transpose() * off;
      window.towards += from_camera.transpose() * ray.direction;
    }
    window.depth += static_cast<double>(rays.size()) * point.transpose() * point;
    ++used;
  }
  if (used >= kFewestOfWindow) windows_.push_back(window);
}

bool ForceFit::beats(const ForceFit& other) const {
  constexpr double kNearlyAll = 0.8;
  std::size_t smaller = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) smaller += errors[i] < other.errors[i] ? 1 : 0;
  return static_cast<double>(smaller) > kNearlyAll * static_cast<double>(errors.size());
}

ForceFit ForceFitter::fit(const Eigen::Matrix3d& axes) const {
  // Maps the columns to v, g, s.
  Eigen::Matrix<double, kColumns, 7> join = Eigen::Matrix<double, kColumns, 7>::Zero();
  join.topLeftCorner<kReadingsAt, kReadingsAt>().setIdentity();
  for (int j = 0; j < 3; ++j) join.block<3, 1>(kReadingsAt + 3 * j, 6) = axes.col(j);
  join(kLeverAt, 6) = 1;
  ForceFit fit;
  std::vector<double> gravities;
  double logs = 0;
  for (const Window& window : windows_) {
    const Matrix7 error = join.transpose() * window.error * join;
    Matrix7 depth = join.transpose() * window.depth * join;
    depth.diagonal().array() += 1e-9 * depth.trace();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix7> solver(error, depth);
    const double square = std::max(solver.eigenvalues()[0], 0.0) + kLeastSquare;
    logs += std::log(square);
    fit.errors.push_back(std::sqrt(square) * focal_);
    if (solver.eigenvalues()[1] < kDistinct * square) continue;
    Vector7 unknowns = solver.eigenvectors().col(0);
    if (window.towards.dot(join * unknowns) < 0) unknowns = -unknowns;
    ++fit.windows;
    if (unknowns[6] < 0) ++fit.negative;
    gravities.push_back(unknowns.segment<3>(kGravityAt).norm() / std::abs(unknowns[6]));
  }
  if (gravities.empty()) return fit;
  std::ranges::sort(gravities);
  fit.gravity = gravities[gravities.size() / 2];
  fit.error = std::sqrt(std::exp(logs / static_cast<double>(windows_.size()))) * focal_;
  return fit;
}

}  // namespace swiftlet
