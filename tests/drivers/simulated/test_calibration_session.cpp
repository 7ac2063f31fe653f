#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "drivers/simulated/calibration_session.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

CameraKind lensOf(std::uint64_t seed) {
  return seed % 2 == 0 ? CameraKind::kPinholeRadtan : CameraKind::kEquidistant;
}

CalibrationSession shortSession(std::uint64_t seed, double duration = 10) {
  SessionSettings settings;
  settings.seed = seed;
  settings.duration = duration;
  return {drawCalibrationRig(seed, lensOf(seed)), CalibrationTarget{}, settings};
}

// The formulas of the two lenses as their papers give them, apart from the project's camera model.
Eigen::Vector2d projectByFormula(const CameraModel& lens, const Eigen::Vector3d& p) {
  const Eigen::Vector4d& f = lens.intrinsics();
  const Eigen::Vector4d& k = lens.distortion();
  double a = 0;
  double b = 0;
  if (lens.kind() == CameraKind::kPinholeRadtan) {
    const double x = p.x() / p.z();
    const double y = p.y() / p.z();
    const double r2 = std::pow(x, 2) + std::pow(y, 2);
    const double factor = 1 + k[0] * r2 + k[1] * std::pow(r2, 2);
    a = x * factor + 2 * k[2] * x * y + k[3] * (r2 + 2 * std::pow(x, 2));
    b = y * factor + k[2] * (r2 + 2 * std::pow(y, 2)) + 2 * k[3] * x * y;
  } else {
    const double theta = std::acos(p.z() / p.norm());
    double radius = theta;
    for (int i = 0; i < 4; ++i) radius += k[i] * std::pow(theta, 2 * i + 3);
    const double angle = std::atan2(p.y(), p.x());
    a = radius * std::cos(angle);
    b = radius * std::sin(angle);
  }
  return {f[0] * a + f[2], f[1] * b + f[3]};
}

TEST_CASE("drawn rigs stay within what they promise") {
  int rolling = 0;
  std::array<double, 2> narrowest{1e9, 1e9};
  std::array<double, 2> widest{};
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const CalibrationRig drawn = drawCalibrationRig(seed, lensOf(seed));
    const Rig& rig = drawn.rig;
    REQUIRE(rig.camera_count == 2);
    CHECK(rig.baseline() == Approx(0.165).margin(0.135 + 1e-9));
    CHECK(std::abs(rig.camera_to_imu_shift.ns) <= 10'000'000);
    CHECK(rig.T_body_cam[0].translation.norm() <= 0.10);
    CHECK(2 * std::acos(std::abs(rig.T_cam1_cam0().rotation.w())) < 5 * kDegree);
    CHECK(drawn.accel_matrix(0, 1) == 0);
    CHECK((drawn.gyro_matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 0.03);
    rolling += rig.rolls() ? 1 : 0;
    if (rig.rolls()) CHECK(rig.readout.seconds() == Approx(0.015).margin(0.010));
    for (std::size_t c = 0; c < 2; ++c) {
      const CameraModel& lens = rig.camera[c];
      // Round trip at the border, through the formulas.
      for (int i = 0; i < 40; ++i) {
        const double u = (lens.width() - 1) * std::min(1.0, i % 20 / 10.0);
        const double v = (lens.height() - 1) * (i < 20 ? 0.0 : 1.0);
        Eigen::Vector3d ray;
        REQUIRE(lens.unproject({u, v}, ray));
        CHECK((projectByFormula(lens, ray) - Eigen::Vector2d(u, v)).norm() < 1e-6);
      }
      Eigen::Vector3d left;
      Eigen::Vector3d right;
      REQUIRE(lens.unproject({0, lens.intrinsics()[3]}, left));
      REQUIRE(lens.unproject({lens.width() - 1.0, lens.intrinsics()[3]}, right));
      const double across = (std::acos(left.z()) + std::acos(right.z())) / kDegree;
      narrowest[seed % 2] = std::min(narrowest[seed % 2], across);
      widest[seed % 2] = std::max(widest[seed % 2], across);
    }
    CHECK(drawCalibrationRig(seed, lensOf(seed)).rig.camera[1].distortion() == rig.camera[1].distortion());
  }
  CHECK(rolling > 60);
  CHECK(rolling < 140);
  // Half a percent of focal length and some pixels of the centre beyond what was drawn.
  CHECK(narrowest[0] == Approx(60).margin(3));
  CHECK(widest[0] == Approx(100).margin(3));
  CHECK(narrowest[1] == Approx(100).margin(5));
  CHECK(widest[1] == Approx(190).margin(5));
}

TEST_CASE("corners of a session are where the truth at their row's time projects them") {
  for (std::uint64_t seed = 11; seed < 23; ++seed) {
    const CalibrationSession session = shortSession(seed);
    const Rig& rig = session.truth().rig;
    std::size_t checked = 0;
    for (int k = 0; k < session.imageCount(); k += 7) {
      for (const BoardView& view : session.exactViews(k)) {
        const CameraModel& lens = rig.camera[view.camera];
        CHECK(view.stamp == session.imageStamp(k));
        const Stamp by_imu = view.stamp + rig.camera_to_imu_shift;
        CHECK(std::abs((by_imu - session.settings().start).seconds() - session.imageTime(k)) < 2e-9);
        int last = -1;
        for (const BoardCorner& corner : view.corners) {
          CHECK(corner.id > last);
          last = corner.id;
          const double row = corner.pixel.y() / (lens.height() - 1) - 0.5;
          const SE3 T_world_body =
              session.trajectory().pose(session.imageTime(k) + row * rig.readout.seconds());
          const Eigen::Vector3d p_world = session.T_world_board() * session.target().corner(corner.id);
          const Eigen::Vector3d p_body = T_world_body.R().transpose() * (p_world - T_world_body.translation);
          const SE3& T_body_cam = rig.T_body_cam[view.camera];
          const Eigen::Vector3d p_cam = T_body_cam.R().transpose() * (p_body - T_body_cam.translation);
          CHECK((projectByFormula(lens, p_cam) - corner.pixel).norm() < 1e-7);
          CHECK(lens.inImage(corner.pixel, session.settings().border));
          ++checked;
        }
        CHECK(view.corners.size() % 4 == 0);
      }
    }
    CHECK(checked > 1000);
  }
}

TEST_CASE("corner noise has the given strength and does not depend on the order of asking") {
  SessionSettings settings;
  settings.duration = 20;
  settings.corner_sigma = {0.1, 0.3};
  const CalibrationSession session(drawCalibrationRig(5, CameraKind::kPinholeRadtan), CalibrationTarget{},
                                   settings);
  std::array<double, 2> square{};
  std::array<double, 2> sum{};
  std::array<double, 2> count{};
  for (int k = session.imageCount() - 1; k >= 0; k -= 3) {
    const std::vector<BoardView> exact = session.exactViews(k);
    const std::vector<BoardView> noisy = session.views(k);
    for (std::size_t c = 0; c < 2; ++c) {
      REQUIRE(noisy[c].corners.size() == exact[c].corners.size());
      for (std::size_t i = 0; i < exact[c].corners.size(); ++i) {
        const Eigen::Vector2d error = noisy[c].corners[i].pixel - exact[c].corners[i].pixel;
        square[c] += error.squaredNorm();
        sum[c] += error.sum();
        count[c] += 2;
      }
    }
  }
  for (std::size_t c = 0; c < 2; ++c) {
    REQUIRE(count[c] > 5000);
    const double sigma = settings.corner_sigma[c];
    CHECK(std::sqrt(square[c] / count[c]) == Approx(sigma).epsilon(5 / std::sqrt(2 * count[c])));
    CHECK(std::abs(sum[c] / count[c]) < 5 * sigma / std::sqrt(count[c]));
  }
  CHECK(session.views(9)[0].corners[3].pixel == session.views(9)[0].corners[3].pixel);
}

TEST_CASE("the IMU of a session reads the motion through its matrices and biases") {
  CalibrationRig rig = drawCalibrationRig(7, CameraKind::kEquidistant);
  SessionSettings settings;
  settings.duration = 30;
  settings.imu_axes << 0, 1, 0, 1, 0, 0, 0, 0, 1;  // left-handed
  const CalibrationSession session(rig, CalibrationTarget{}, settings);
  const SimulatedImu& imu = session.imu();
  const double rate = rig.noise.rate_hz;
  Eigen::Vector3d gyro_square = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_square = Eigen::Vector3d::Zero();
  double count = 0;
  for (std::size_t k = 10; k + 10 < imu.samples.size(); ++k) {
    // Rates and accelerations by differences of poses.
    const double t = static_cast<double>(k) / rate;
    constexpr double kStep = 1e-3;
    const SE3 before = session.trajectory().pose(t - kStep);
    const SE3 now = session.trajectory().pose(t);
    const SE3 after = session.trajectory().pose(t + kStep);
    const Eigen::Vector3d omega = logSo3(before.rotation.conjugate() * after.rotation) / (2 * kStep);
    const Eigen::Vector3d force =
        (after.translation - 2 * now.translation + before.translation) / (kStep * kStep) +
        Eigen::Vector3d(0, 0, rig.noise.gravity);
    const Eigen::Vector3d gyro = settings.imu_axes * (rig.gyro_matrix * omega) + imu.bias_gyro[k];
    const Eigen::Vector3d accel =
        settings.imu_axes * (rig.accel_matrix * (now.rotation.conjugate() * force)) + imu.bias_accel[k];
    gyro_square += (imu.samples[k].gyro - gyro).cwiseAbs2();
    accel_square += (imu.samples[k].accel - accel).cwiseAbs2();
    ++count;
  }
  for (int axis = 0; axis < 3; ++axis) {
    CHECK(std::sqrt(gyro_square[axis] / count) ==
          Approx(rig.noise.gyro_density * std::sqrt(rate)).epsilon(0.05));
    CHECK(std::sqrt(accel_square[axis] / count) ==
          Approx(rig.noise.accel_density * std::sqrt(rate)).epsilon(0.05));
  }
}

TEST_CASE("a session shows the board everywhere, near and far, tilted, and excites every axis") {
  constexpr int kColumns = 6;
  constexpr int kRows = 4;
  for (std::uint64_t seed = 31; seed < 43; ++seed) {
    const CalibrationSession session = shortSession(seed, 60);
    const Rig& rig = session.truth().rig;
    std::array<std::array<int, kColumns * kRows>, 2> cells{};
    double nearest = 1e9;
    double farthest = 0;
    double most_tilt = 0;
    int views = 0;
    int partial = 0;
    for (int k = 0; k < session.imageCount(); k += 4) {
      for (const BoardView& view : session.exactViews(k)) {
        const CameraModel& lens = rig.camera[view.camera];
        for (const BoardCorner& corner : view.corners) {
          const int x = std::min(kColumns - 1, static_cast<int>(corner.pixel.x() * kColumns / lens.width()));
          const int y = std::min(kRows - 1, static_cast<int>(corner.pixel.y() * kRows / lens.height()));
          ++cells[view.camera][static_cast<std::size_t>(y * kColumns + x)];
        }
        if (view.corners.empty()) continue;
        ++views;
        partial += view.corners.size() < 144 ? 1 : 0;
        const SE3 T_board_cam = session.T_world_board().inverse() *
                                session.trajectory().pose(session.imageTime(k)) * rig.T_body_cam[view.camera];
        const Eigen::Vector3d to_camera = T_board_cam.translation - 0.5 * session.target().corner(142);
        nearest = std::min(nearest, to_camera.norm());
        farthest = std::max(farthest, to_camera.norm());
        most_tilt = std::max(most_tilt, std::acos(to_camera.normalized().z()));
      }
    }
    INFO("seed " << seed << ": " << views << " views, " << partial << " partial, " << nearest << " to "
                 << farthest << " m, tilt " << most_tilt / kDegree);
    for (const auto& camera : cells) {
      CHECK(std::count(camera.begin(), camera.end(), 0) <= 1);
    }
    CHECK(views > 0.85 * 2 * session.imageCount() / 4);
    CHECK(partial > views / 4);
    CHECK(farthest > 1.8 * nearest);
    CHECK(most_tilt > 30 * kDegree);
    CHECK(most_tilt < 65 * kDegree);
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();
    Eigen::Vector3d push = Eigen::Vector3d::Zero();
    double fastest = 0;
    for (int i = 0; i < 6000; ++i) {
      const MotionState motion = session.trajectory().at(0.01 * i);
      turn += motion.omega_body.cwiseAbs2() / 6000;
      push += (motion.T_world_body.rotation.conjugate() * motion.a_world_body).cwiseAbs2() / 6000;
      fastest = std::max(fastest, motion.omega_body.norm());
    }
    CHECK(turn.cwiseSqrt().minCoeff() > 0.15);  // rad/s
    CHECK(push.cwiseSqrt().minCoeff() > 0.3);   // m/s^2
    CHECK(fastest < 4);                         // rad/s: what a hand does
  }
}

TEST_CASE("sessions with bad data are bad in the way that was asked for") {
  const CalibrationRig rig = drawCalibrationRig(2, CameraKind::kPinholeRadtan);
  SessionSettings settings;
  settings.duration = 20;
  settings.turning = Turning::kNoRoll;
  const CalibrationSession no_roll(rig, CalibrationTarget{}, settings);
  settings.turning = Turning::kNone;
  const CalibrationSession no_turn(rig, CalibrationTarget{}, settings);
  Eigen::Vector3d turned = Eigen::Vector3d::Zero();
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d omega_cam =
        rig.rig.T_body_cam[0].rotation.conjugate() * no_roll.trajectory().at(0.01 * i).omega_body;
    turned = turned.cwiseMax(omega_cam.cwiseAbs());
    CHECK(no_turn.trajectory().at(0.01 * i).omega_body.norm() < 1e-9);
  }
  CHECK(turned.x() > 0.3);
  CHECK(turned.y() > 0.3);
  CHECK(turned.z() < 0.02);

  settings.turning = Turning::kAll;
  settings.rests = {{5, 8}};
  settings.clock_drift = 1e-3;
  settings.clock_offset = Duration::fromMilliseconds(700);
  const CalibrationSession rested(rig, CalibrationTarget{}, settings);
  for (double t = 5.3; t < 7.7; t += 0.1) {
    CHECK(rested.trajectory().at(t).omega_body.norm() < 1e-9);
    CHECK(rested.trajectory().at(t).v_world_body.norm() < 1e-9);
  }
  CHECK(rested.trajectory().at(3).v_world_body.norm() > 1e-3);
  const double late = (rested.imageStamp(200) + rig.rig.camera_to_imu_shift - settings.start).seconds();
  CHECK(late - rested.imageTime(200) == Approx(0.7 + 1e-3 * rested.imageTime(200)).margin(1e-8));
}

}  // namespace
}  // namespace swiftlet
