#include "firmware_host/lab/calibrate/check/flight_piece.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "estimator/geometry/so3.hpp"
#include "estimator/smoother/gyro_intrinsics_state.hpp"
#include "estimator/smoother/imu_factor.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {
namespace {

using change::kCount;

// Accuracy of the flight's biases at the start of a piece.
constexpr double kGyroBiasPrior = 0.02;  // rad/s
constexpr double kAccelBiasPrior = 0.3;  // m/s^2
constexpr double kGaugePrior = 1e-6;     // m, rad: the first position and yaw, which are unobservable
constexpr double kLargestInverseDepth = 20;
constexpr std::size_t kFewestSightings = 3;
constexpr double kOutlier = 6;  // sigmas

struct View {
  std::size_t keyframe = 0;
  std::size_t camera = 0;
  Eigen::Vector2d pixel;
};

/// A point on the ray from a fixed anchor: anchor + bearing / inverse_depth.
struct Point {
  Eigen::Vector3d anchor;
  Eigen::Vector3d bearing;
  double inverse_depth = 0.1;
  std::vector<View> views;
};

struct Link {
  Preintegration imu;
  Eigen::Vector3d mean_accel = Eigen::Vector3d::Zero();
  ImuNoise noise;
  bool used = false;
};

struct Solution {
  std::vector<BodyState> states;
  std::vector<Point> points;
  CalibrationChange change = CalibrationChange::Zero();
};

class Piece {
 public:
  Piece(const Rig& rig, const ImuNoise& noise, const std::vector<FlightKeyframe>& keyframes, ImagePart part)
      : rig_(rig), keyframes_(keyframes), part_(part), priors_(changePriors()) {
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      const NavState& state = keyframes[k].state;
      now_.states.push_back({state.T_world_body, state.v_world_body, state.bias_gyro, state.bias_accel});
      rates_.push_back(rateAt(keyframes[k]));
      links_.push_back(k == 0 ? Link{} : linkTo(keyframes[k - 1], keyframes[k], noise));
    }
    gatherPoints();
  }

  PieceResult solve() {
    PieceResult result;
    result.begin = keyframes_.front().frame.stamp;
    result.end = keyframes_.back().frame.stamp;
    result.points = now_.points.size();
    constexpr std::size_t kFewestPoints = 30;
    if (now_.points.size() < kFewestPoints) return result;
    double damping = 1e-6;
    double cost = linearize(now_, true);
    constexpr int kIterations = 25;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Solution before = now_;
      if (!step(damping)) return result;
      const double next = linearize(now_, false);
      if (!(next < cost)) {
        now_ = before;
        damping *= 10;
        if (damping > 1e2) break;
        continue;
      }
      const bool done = cost - next < 1e-5 * cost;
      damping = std::max(damping / 10, 1e-9);
      cost = linearize(now_, true);
      if (done) break;
    }
    linearize(now_, true);
    finish(result);
    return result;
  }

 private:
  Eigen::Index columns() const { return static_cast<Eigen::Index>(15 * keyframes_.size()) + kCount; }
  Eigen::Index calibrationColumn() const { return static_cast<Eigen::Index>(15 * keyframes_.size()); }

  [[nodiscard]] Eigen::Vector3d rateAt(const FlightKeyframe& keyframe) const {
    Eigen::Vector3d rate = keyframe.state.bias_gyro;
    std::int64_t nearest = 1'000'000'000;
    for (const ImuSample& sample : keyframe.samples) {
      const std::int64_t off = std::abs((sample.stamp - keyframe.frame.stamp - rig_.camera_to_imu_shift).ns);
      if (off >= nearest) continue;
      nearest = off;
      rate = sample.gyro;
    }
    return rate - keyframe.state.bias_gyro;
  }

  Link linkTo(const FlightKeyframe& from, const FlightKeyframe& to, const ImuNoise& noise) const {
    Link link;
    link.noise = noise.times(to.noise.imu);
    link.imu = Preintegration(link.noise, from.state.bias_gyro, from.state.bias_accel);
    const Stamp begin = from.frame.stamp + rig_.camera_to_imu_shift;
    const Stamp end = to.frame.stamp + rig_.camera_to_imu_shift;
    link.used = link.imu.integrate(to.samples, begin, end).ok() && link.imu.gapDuration() == 0;
    double count = 0;
    for (const ImuSample& sample : to.samples) {
      if (sample.stamp < begin || sample.stamp > end) continue;
      link.mean_accel += sample.accel;
      ++count;
    }
    if (count > 0) link.mean_accel /= count;
    return link;
  }

  void gatherPoints() {
    std::map<TrackId, Point> tracks;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      for (const TrackedFeature& feature : keyframes_[k].frame.features) {
        for (std::size_t c = 0; c < rig_.camera_count; ++c) {
          const Eigen::Vector2d pixel = feature.pixel[c].cast<double>();
          if (feature.seen[c] && counts(c, pixel)) tracks[feature.id].views.push_back({k, c, pixel});
        }
      }
    }
    for (auto& [id, point] : tracks) {
      if (point.views.size() >= kFewestSightings && place(point)) now_.points.push_back(point);
    }
  }

  [[nodiscard]] bool counts(std::size_t camera, const Eigen::Vector2d& pixel) const {
    if (part_ == ImagePart::kAll) return true;
    const CameraModel& model = rig_.camera[camera];
    constexpr double kHalf = 0.159;  // pi r^2 is half of the image
    const double from_centre = (pixel - model.intrinsics().tail<2>()).squaredNorm();
    return (from_centre < kHalf * model.width() * model.height()) == (part_ == ImagePart::kInner);
  }

  struct Placed {
    Eigen::Matrix3d R_world_body;
    SE3 T_body_cam0;
    SE3 T_cam0_cam1;
    double moved = 0;  // s, from the state's stamp to the pose
  };
  Placed placed(const Solution& at, const View& view) const {
    Placed p;
    p.moved = at.change[change::kShift] + rig_.rowTime(view.camera, view.pixel.y());
    p.R_world_body =
        (at.states[view.keyframe].T_world_body.rotation * expSo3(rates_[view.keyframe] * p.moved))
            .toRotationMatrix();
    p.T_body_cam0 = changed(rig_.T_body_cam[0], at.change, change::kTurn);
    if (view.camera == 1) {
      p.T_cam0_cam1 = changed(rig_.T_body_cam[0].inverse() * rig_.T_body_cam[1], at.change, change::kRigTurn);
    }
    return p;
  }
  static SE3 changed(const SE3& T, const CalibrationChange& by, int column) {
    return {T.rotation * expSo3(by.segment<3>(column)), T.translation + by.segment<3>(column + 3)};
  }

  /// The point for a view, times its inverse depth: in the body, in camera 0 and in the view's camera.
  struct Seen {
    Placed at;
    Eigen::Vector3d body, cam0, cam;
  };
  Seen see(const Solution& at, const Point& point, const View& view) const {
    Seen seen;
    seen.at = placed(at, view);
    const BodyState& state = at.states[view.keyframe];
    const Eigen::Vector3d position = state.T_world_body.translation + state.v_world_body * seen.at.moved;
    seen.body =
        seen.at.R_world_body.transpose() * (point.inverse_depth * (point.anchor - position) + point.bearing);
    seen.cam0 = seen.at.T_body_cam0.rotation.conjugate() *
                (seen.body - point.inverse_depth * seen.at.T_body_cam0.translation);
    seen.cam = seen.cam0;
    if (view.camera == 1) {
      seen.cam = seen.at.T_cam0_cam1.rotation.conjugate() *
                 (seen.cam0 - point.inverse_depth * seen.at.T_cam0_cam1.translation);
    }
    return seen;
  }

  /// Pixel with the changed focal length.
  bool project(const Solution& at, const View& view, const Eigen::Vector3d& p, Eigen::Vector2d& pixel,
               Matrix23d* jacobian) const {
    const CameraModel& model = rig_.camera[view.camera];
    if (!model.project(p, pixel, jacobian)) return false;
    const double scale = 1 + at.change[change::kFocal + static_cast<int>(view.camera)];
    const Eigen::Vector2d centre = model.intrinsics().tail<2>();
    pixel = centre + scale * (pixel - centre);
    if (jacobian != nullptr) *jacobian *= scale;
    return true;
  }

  /// Places a point from its first view, at the inverse depth that fits the others best.
  bool place(Point& point) const {
    const View& first = point.views.front();
    const Placed p = placed(now_, first);
    const SE3 T_body_cam = first.camera == 0 ? p.T_body_cam0 : p.T_body_cam0 * p.T_cam0_cam1;
    Eigen::Vector3d ray;
    if (!rig_.camera[first.camera].unproject(first.pixel, ray)) return false;
    point.anchor = now_.states[first.keyframe].T_world_body * T_body_cam.translation;
    point.bearing = p.R_world_body * (T_body_cam.rotation * ray);
    double best = 1e300;
    for (const double inverse_depth :
         {0.003, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.9, 1.4, 2.5}) {
      Point tried = point;
      tried.inverse_depth = inverse_depth;
      double cost = 0;
      for (const View& view : point.views) {
        Eigen::Vector2d pixel;
        const bool good = project(now_, view, see(now_, tried, view).cam, pixel, nullptr);
        cost += good ? std::log1p((pixel - view.pixel).squaredNorm()) : 20;
      }
      if (cost >= best) continue;
      best = cost;
      point.inverse_depth = inverse_depth;
    }
    return true;
  }

  double sigma(const View& view) const { return keyframes_[view.keyframe].noise.pixel_sigma; }

  double linearize(const Solution& at, bool build) {
    if (build) {
      H_.setZero(columns(), columns());
      b_.setZero(columns());
      eliminated_.assign(at.points.size(), {});
    }
    double cost = 0;
    for (std::size_t i = 0; i < at.points.size(); ++i) cost += addPoint(at, i, build);
    for (std::size_t k = 1; k < keyframes_.size(); ++k) cost += addLink(at, k, build);
    cost += addPriors(at, build);
    return cost;
  }

  /// Kept for a point's own step.
  struct Eliminated {
    Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    std::vector<Eigen::Index> columns;  // of six, or of the calibration at the end
    Eigen::Matrix<double, 3, Eigen::Dynamic> W;
  };

  double addPoint(const Solution& at, std::size_t index, bool build) {
    const Point& point = at.points[index];
    const PointBasis basis = PointBasis::of(point.bearing);
    Eliminated& kept = eliminated_[index];
    Eigen::Matrix3d H_pp = Eigen::Matrix3d::Zero();
    H_pp(2, 2) = kInverseDepthInformation;
    Eigen::Vector3d g_p(0, 0, -kInverseDepthInformation * point.inverse_depth);
    double cost = 0.5 * kInverseDepthInformation * point.inverse_depth * point.inverse_depth;
    if (build) {
      kept.columns.clear();
      for (const View& view : point.views) {
        const auto column = static_cast<Eigen::Index>(15 * view.keyframe);
        if (kept.columns.empty() || kept.columns.back() != column) kept.columns.push_back(column);
      }
      kept.W.setZero(3, static_cast<Eigen::Index>(6 * kept.columns.size()) + kCount);
    }
    std::size_t slot = 0;
    for (const View& view : point.views) {
      const Seen seen = see(at, point, view);
      Eigen::Vector2d pixel;
      Matrix23d J_proj;
      constexpr double kBehind = 10;  // sigmas, a constant cost
      if (!project(at, view, seen.cam, pixel, build ? &J_proj : nullptr)) {
        cost += RobustWeight::cauchy(kBehind * kBehind).cost;
        continue;
      }
      const double inverse_sigma = 1 / sigma(view);
      const Eigen::Vector2d residual = inverse_sigma * (view.pixel - pixel);
      const RobustWeight robust = RobustWeight::cauchy(residual.squaredNorm());
      cost += robust.cost;
      if (!build) continue;
      const double rho = point.inverse_depth;
      const BodyState& state = at.states[view.keyframe];
      const Eigen::Matrix3d R_body_world = seen.at.R_world_body.transpose();
      const Eigen::Matrix3d R_cam0_body = seen.at.T_body_cam0.R().transpose();
      const Eigen::Matrix3d R_cam_cam0 = view.camera == 1
                                             ? Eigen::Matrix3d(seen.at.T_cam0_cam1.R().transpose())
                                             : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
      const Matrix23d J_cam0 = -inverse_sigma * J_proj * R_cam_cam0;
      const Matrix23d J_body = J_cam0 * R_cam0_body;
      Eigen::Matrix<double, 2, 6> J_pose;
      // The state's own rotation: the pose differs by Exp(rate moved), which is small.
      J_pose.leftCols<3>() = J_body * hat(seen.body);
      J_pose.rightCols<3>() = -rho * J_body * R_body_world;
      Eigen::Matrix<double, 2, kCount> J_cal = Eigen::Matrix<double, 2, kCount>::Zero();
      J_cal.col(change::kShift) =
          J_body * (hat(seen.body) * rates_[view.keyframe] - rho * R_body_world * state.v_world_body);
      J_cal.middleCols<3>(change::kTurn) = J_cam0 * hat(seen.cam0);
      J_cal.middleCols<3>(change::kMove) = -rho * J_cam0 * R_cam0_body;
      const Eigen::Vector2d centre = rig_.camera[view.camera].intrinsics().tail<2>();
      const int focal = change::kFocal + static_cast<int>(view.camera);
      J_cal.col(focal) = -inverse_sigma * (pixel - centre) / (1 + at.change[focal]);
      if (view.camera == 1) {
        J_cal.middleCols<3>(change::kRigTurn) = -inverse_sigma * J_proj * hat(seen.cam);
        J_cal.middleCols<3>(change::kRigMove) = -rho * J_cam0;
      }
      Matrix23d J_point;
      J_point.col(0) = J_body * (R_body_world * basis.b1);
      J_point.col(1) = J_body * (R_body_world * basis.b2);
      const Eigen::Vector3d position = state.T_world_body.translation + state.v_world_body * seen.at.moved;
      Eigen::Vector3d by_depth = R_body_world * (point.anchor - position) - seen.at.T_body_cam0.translation;
      J_point.col(2) = J_body * by_depth;
      if (view.camera == 1) J_point.col(2) -= J_cam0 * seen.at.T_cam0_cam1.translation;

      const auto column = static_cast<Eigen::Index>(15 * view.keyframe);
      while (kept.columns[slot] != column) ++slot;
      const double w = robust.weight;
      const Eigen::Index cal = calibrationColumn();
      H_pp += w * J_point.transpose() * J_point;
      g_p -= w * J_point.transpose() * residual;
      kept.W.middleCols<6>(static_cast<Eigen::Index>(6 * slot)) += w * J_point.transpose() * J_pose;
      kept.W.rightCols<kCount>() += w * J_point.transpose() * J_cal;
      H_.block<6, 6>(column, column) += w * J_pose.transpose() * J_pose;
      H_.block<6, kCount>(column, cal) += w * J_pose.transpose() * J_cal;
      H_.block<kCount, kCount>(cal, cal) += w * J_cal.transpose() * J_cal;
      b_.segment<6>(column) -= w * J_pose.transpose() * residual;
      b_.segment<kCount>(cal) -= w * J_cal.transpose() * residual;
    }
    if (!build) return cost;
    kept.inverse = H_pp.inverse();
    kept.gradient = g_p;
    const Eigen::Matrix<double, 3, Eigen::Dynamic> VW = kept.inverse * kept.W;
    const std::size_t blocks = kept.columns.size();
    const auto at_slot = [&](std::size_t s) { return static_cast<Eigen::Index>(6 * s); };
    const Eigen::Index cal = calibrationColumn();
    for (std::size_t r = 0; r < blocks; ++r) {
      const auto W_r = kept.W.middleCols<6>(at_slot(r));
      for (std::size_t c = r; c < blocks; ++c) {
        H_.block<6, 6>(kept.columns[r], kept.columns[c]) -= W_r.transpose() * VW.middleCols<6>(at_slot(c));
      }
      H_.block<6, kCount>(kept.columns[r], cal) -= W_r.transpose() * VW.rightCols<kCount>();
      b_.segment<6>(kept.columns[r]) -= VW.middleCols<6>(at_slot(r)).transpose() * g_p;
    }
    H_.block<kCount, kCount>(cal, cal) -= kept.W.rightCols<kCount>().transpose() * VW.rightCols<kCount>();
    b_.segment<kCount>(cal) -= VW.rightCols<kCount>().transpose() * g_p;
    return cost;
  }

  double addLink(const Solution& at, std::size_t k, bool build) {
    const Link& link = links_[k];
    if (!link.used) return 0;
    BodyState from = at.states[k - 1];
    const Eigen::Vector3d by_scale = at.change.segment<3>(change::kAccel).cwiseProduct(link.mean_accel);
    from.bias_accel += by_scale;
    GyroIntrinsicsState gyro(true, change::kGyro);
    gyro.retract(at.change);
    MotionFactor factor;
    if (!imuFactor(link.imu, link.noise, from, at.states[k], factor, &gyro)) return 0;
    // The bias's random walk does not include the scale.
    factor.residual.tail<3>() += factor.jacobian_j(12, 12) * by_scale;
    const double cost = 0.5 * factor.residual.squaredNorm();
    if (!build) return cost;
    Eigen::Matrix<double, 15, 30 + kCount> J = Eigen::Matrix<double, 15, 30 + kCount>::Zero();
    J.leftCols<15>() = factor.jacobian_i;
    J.middleCols<15>(15) = factor.jacobian_j;
    J.block<9, kGyroMatrixDim>(0, 30 + change::kGyro) = factor.jacobian_gyro_matrix;
    J.block<9, 3>(0, 30 + change::kAccel) =
        factor.jacobian_i.block<9, 3>(0, 12) * link.mean_accel.asDiagonal();
    const Eigen::Matrix<double, 30 + kCount, 30 + kCount> JJ = J.transpose() * J;
    const Eigen::Matrix<double, 30 + kCount, 1> g = -J.transpose() * factor.residual;
    const auto first = static_cast<Eigen::Index>(15 * (k - 1));
    const Eigen::Index cal = calibrationColumn();
    H_.block<30, 30>(first, first) += JJ.topLeftCorner<30, 30>();
    H_.block<30, kCount>(first, cal) += JJ.topRightCorner<30, kCount>();
    H_.block<kCount, kCount>(cal, cal) += JJ.bottomRightCorner<kCount, kCount>();
    b_.segment<30>(first) += g.head<30>();
    b_.segment<kCount>(cal) += g.tail<kCount>();
    return cost;
  }

  double addPriors(const Solution& at, bool build) {
    double cost = 0;
    const auto prior = [&](Eigen::Index column, double off, double sigma) {
      const double information = 1 / (sigma * sigma);
      cost += 0.5 * information * off * off;
      if (!build) return;
      H_(column, column) += information;
      b_[column] -= information * off;
    };
    const NavState& given = keyframes_.front().state;
    const BodyState& first = at.states.front();
    for (int i = 0; i < 3; ++i) {
      prior(3 + i, (first.T_world_body.translation - given.T_world_body.translation)[i], kGaugePrior);
      prior(9 + i, (first.bias_gyro - given.bias_gyro)[i], kGyroBiasPrior);
      prior(12 + i, (first.bias_accel - given.bias_accel)[i], kAccelBiasPrior);
    }
    for (int i = 0; i < kCount; ++i) prior(calibrationColumn() + i, at.change[i], priors_[i]);
    // Yaw: rotation about the world's vertical.
    const Eigen::Vector3d up_body = first.T_world_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const double yaw =
        up_body.dot(logSo3(given.T_world_body.rotation.conjugate() * first.T_world_body.rotation));
    const double information = 1 / (kGaugePrior * kGaugePrior);
    cost += 0.5 * information * yaw * yaw;
    if (build) {
      H_.topLeftCorner<3, 3>() += information * up_body * up_body.transpose();
      b_.head<3>() -= information * yaw * up_body;
    }
    return cost;
  }

  bool step(double damping) {
    Eigen::MatrixXd damped = H_.selfadjointView<Eigen::Upper>();
    damped.diagonal() *= 1 + damping;
    const Eigen::LDLT<Eigen::MatrixXd> factor(damped);
    if (factor.info() != Eigen::Success) return false;
    const Eigen::VectorXd x = factor.solve(b_);
    if (!x.allFinite()) return false;
    for (std::size_t k = 0; k < now_.states.size(); ++k) {
      now_.states[k].retract(x.segment<15>(static_cast<Eigen::Index>(15 * k)));
    }
    now_.change += x.tail<kCount>();
    for (std::size_t i = 0; i < now_.points.size(); ++i) {
      const Eliminated& kept = eliminated_[i];
      Eigen::Vector3d moved = kept.gradient - kept.W.rightCols<kCount>() * x.tail<kCount>();
      for (std::size_t s = 0; s < kept.columns.size(); ++s) {
        moved -= kept.W.middleCols<6>(static_cast<Eigen::Index>(6 * s)) * x.segment<6>(kept.columns[s]);
      }
      moved = kept.inverse * moved;
      Point& point = now_.points[i];
      const PointBasis basis = PointBasis::of(point.bearing);
      const Eigen::Vector3d bearing = point.bearing + moved[0] * basis.b1 + moved[1] * basis.b2;
      const double scale = 1 / bearing.norm();
      point.bearing = bearing * scale;
      point.inverse_depth = std::clamp((point.inverse_depth + moved[2]) * scale, 0.0, kLargestInverseDepth);
    }
    return true;
  }

  void finish(PieceResult& result) const {
    const Eigen::MatrixXd H = H_.selfadjointView<Eigen::Upper>();
    const Eigen::Index cal = calibrationColumn();
    const Eigen::LDLT<Eigen::MatrixXd> states(H.topLeftCorner(cal, cal));
    if (states.info() != Eigen::Success) return;
    const Eigen::MatrixXd coupling = H.topRightCorner(cal, kCount);
    result.information =
        H.bottomRightCorner<kCount, kCount>() - coupling.transpose() * states.solve(coupling);
    result.information.diagonal() -= priors_.cwiseAbs2().cwiseInverse();
    result.change = now_.change;
    double squared = 0;
    for (const Point& point : now_.points) {
      std::array<bool, kMaxCameras> by{};
      for (const View& view : point.views) {
        by[view.camera] = true;
        SightingResidual one{keyframes_[view.keyframe].frame.stamp, view.camera, view.pixel};
        Eigen::Vector2d pixel;
        if (!project(now_, view, see(now_, point, view).cam, pixel, nullptr)) continue;
        one.residual = view.pixel - pixel;
        one.outlier = one.residual.norm() > kOutlier * sigma(view);
        if (!one.outlier) {
          squared += one.residual.squaredNorm() / 2;
          ++result.sightings;
        }
        result.residuals.push_back(one);
      }
      if (by[0] && by[1]) ++result.stereo_points;
    }
    result.rms = std::sqrt(squared / static_cast<double>(std::max<std::size_t>(result.sightings, 1)));
    result.solved = result.information.allFinite();
  }

  const Rig& rig_;
  const std::vector<FlightKeyframe>& keyframes_;
  ImagePart part_;
  CalibrationChange priors_;
  std::vector<Eigen::Vector3d> rates_;
  std::vector<Link> links_;
  Solution now_;
  Eigen::MatrixXd H_;  // upper triangle
  Eigen::VectorXd b_;
  std::vector<Eliminated> eliminated_;
};

}  // namespace

CalibrationChange changePriors() {
  constexpr double kShiftSigma = 0.02;  // s
  constexpr double kTurnSigma = 0.05;   // rad
  constexpr double kMoveSigma = 0.05;   // m
  constexpr double kFocalSigma = 0.05;
  constexpr double kRigMoveSigma = 0.02;  // m
  // Accelerometers of drones have scale errors of up to a percent.
  constexpr double kAccelScaleSigma = 1e-2;
  CalibrationChange sigma;
  sigma[change::kShift] = kShiftSigma;
  sigma.segment<3>(change::kTurn).setConstant(kTurnSigma);
  sigma.segment<3>(change::kMove).setConstant(kMoveSigma);
  sigma.segment<2>(change::kFocal).setConstant(kFocalSigma);
  sigma.segment<3>(change::kRigTurn).setConstant(kTurnSigma);
  sigma.segment<3>(change::kRigMove).setConstant(kRigMoveSigma);
  sigma.segment<9>(change::kGyro).setConstant(kGyroMatrixPriorSigma);
  sigma.segment<3>(change::kAccel).setConstant(kAccelScaleSigma);
  return sigma;
}

PieceResult solvePiece(const Rig& rig, const ImuNoise& noise, const std::vector<FlightKeyframe>& keyframes,
                       ImagePart part) {
  return Piece(rig, noise, keyframes, part).solve();
}

}  // namespace swiftlet
