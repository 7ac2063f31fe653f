// Kalibr camchain and IMU YAML, with OpenVINS' variant of the camchain.

#include <fmt/format.h>

#include "drivers/calibration/bare_cameras.hpp"
#include "drivers/calibration/sensor_fields.hpp"
#include "drivers/input/file_tree.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Largest difference between two statements of one transform in one file; Kalibr writes 16 digits.
constexpr double kContradiction = 1e-6;
// Largest deviation of an entry from the identity. MEMS sensors are below 0.05; a transposed matrix or
// rotated axes are far above.
constexpr double kMostImuError = 0.2;
constexpr double kRounding = 1e-12;

double distance(const SE3& a, const SE3& b) {
  const SE3 d = a.inverse() * b;
  return std::max(d.translation.norm(), logSo3(d.rotation).norm());
}

struct ChainCamera {
  YamlField fields;
  std::optional<SE3> T_body_cam;
  std::optional<SE3> T_cam_previous;
  std::string extrinsics_key;
};

ChainCamera readExtrinsics(const YamlField& camera, Warnings& warnings) {
  ChainCamera out{camera, std::nullopt, std::nullopt, ""};
  if (camera.has("T_cam_imu")) {
    out.extrinsics_key = "T_cam_imu";
    out.T_body_cam = readTransform(camera.at("T_cam_imu"), warnings).inverse();
  }
  if (camera.has("T_imu_cam")) {
    const YamlField field = camera.at("T_imu_cam");
    const SE3 T = readTransform(field, warnings);
    if (out.T_body_cam && distance(T, *out.T_body_cam) > kContradiction) {
      throw field.error("contradicts T_cam_imu of the same camera", "Remove the wrong one");
    }
    out.extrinsics_key = "T_imu_cam";
    out.T_body_cam = T;
  }
  if (camera.has("T_cn_cnm1")) {
    out.T_cam_previous = readTransform(camera.at("T_cn_cnm1"), warnings);
    if (out.extrinsics_key.empty()) out.extrinsics_key = "T_cn_cnm1";
  }
  return out;
}

void refuseContradiction(const ChainCamera& previous, const ChainCamera& camera) {
  if (!previous.T_body_cam || !camera.T_body_cam || !camera.T_cam_previous) return;
  const SE3 chained = *previous.T_body_cam * camera.T_cam_previous->inverse();
  const double gap = distance(chained, *camera.T_body_cam);
  if (gap <= kContradiction) return;
  throw camera.fields.at("T_cn_cnm1")
      .error(fmt::format("contradicts {} and {} by {:.3g} (m, rad)",
                         previous.fields.name() + "." + previous.extrinsics_key,
                         camera.fields.name() + "." + camera.extrinsics_key, gap),
             "T_cn_cnm1 maps camera n-1 to camera n; keep the transform that the calibration tool wrote");
}

void chain(std::vector<ChainCamera>& cameras) {
  for (std::size_t i = 1; i < cameras.size(); ++i) {
    refuseContradiction(cameras[i - 1], cameras[i]);
    if (!cameras[i].T_body_cam && cameras[i - 1].T_body_cam && cameras[i].T_cam_previous) {
      cameras[i].T_body_cam = *cameras[i - 1].T_body_cam * cameras[i].T_cam_previous->inverse();
    }
  }
  for (std::size_t i = cameras.size(); i-- > 1;) {
    if (!cameras[i - 1].T_body_cam && cameras[i].T_body_cam && cameras[i].T_cam_previous) {
      cameras[i - 1].T_body_cam = *cameras[i].T_body_cam * *cameras[i].T_cam_previous;
    }
  }
  for (const ChainCamera& camera : cameras) {
    if (camera.T_body_cam) continue;
    throw camera.fields.error(
        "neither T_cam_imu nor T_imu_cam, nor a chain of T_cn_cnm1 to a camera with one",
        "Run the camera-IMU step of the calibration and give its camchain-imucam file");
  }
}

/// `bare`: a chain without an IMU takes camera 0 as the body.
std::vector<CameraEntry> readChain(const YamlField& root, bool bare, Warnings& warnings) {
  std::vector<ChainCamera> cameras;
  for (int i = 0; root.has(fmt::format("cam{}", i)); ++i) {
    if (cameras.size() == kMaxCameras) {
      warnings.push_back(root.file() + ": more than two cameras; cam0 and cam1 are used");
      break;
    }
    const YamlField camera = root.at(fmt::format("cam{}", i));
    if (!camera.isMap())
      throw camera.error("expected a map of the camera's fields", "Give a Kalibr camchain");
    cameras.push_back(readExtrinsics(camera, warnings));
  }
  if (cameras.empty()) throw root.error("no camera `cam0`", "Give a Kalibr camchain file");
  if (bare && !cameras[0].T_body_cam) cameras[0].T_body_cam = SE3();
  chain(cameras);
  std::vector<CameraEntry> entries;
  for (const ChainCamera& camera : cameras) {
    CameraEntry entry;
    entry.lens = readLens(camera.fields, "distortion_coeffs", warnings);
    entry.T_body_cam = *camera.T_body_cam;
    entry.shift_s = readShift(camera.fields, warnings);
    entry.readout_s = readReadout(camera.fields);
    if (camera.fields.has("rostopic")) entry.topic = camera.fields.at("rostopic").text();
    const std::string key = camera.extrinsics_key.empty() ? "T_cn_cnm1" : camera.extrinsics_key;
    entry.file = camera.fields.file();
    entry.line = camera.fields.has(key) ? camera.fields.at(key).line() : camera.fields.line();
    entry.field = camera.fields.name() + "." + key;
    entries.push_back(entry);
  }
  return entries;
}

}  // namespace

void readImuModel(const YamlField& imu, Calibration& calibration) {
  const auto matrixOf = [](const YamlField& field) {
    const std::vector<double> values = readMatrix(field, 3, 3);
    return Eigen::Matrix3d(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.data()));
  };
  const auto at = [&](const YamlField& parent, const char* key) {
    return parent.has(key) ? matrixOf(parent.at(key)) : Eigen::Matrix3d::Identity().eval();
  };
  const auto refuse = [](const YamlField& field, const Eigen::Matrix3d& M) {
    if ((M - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kMostImuError) return;
    throw field.error(fmt::format("a sensor error above {:g}", kMostImuError),
                      "The matrix maps true to measured values and is close to the identity");
  };
  if (imu.has("model")) {
    const YamlField field = imu.at("model");
    if (field.text() == "scale-misalignment-size-effect") {
      throw field.error("positions of single accelerometers are not supported",
                        "Calibrate with `--imu-models scale-misalignment`");
    }
    if (field.text() == "rpng" && imu.has("Tw")) {
      const bool ideal = at(imu, "Tw").isIdentity(kContradiction) && at(imu, "Ta").isIdentity(kContradiction);
      if (!ideal)
        throw field.error("matrices of OpenVINS' model `rpng` are not supported",
                          "Give those of model `kalibr`");
    }
  }
  if (imu.has("accelerometers") && imu.at("accelerometers").isMap()) {
    const YamlField accel = imu.at("accelerometers");
    calibration.accel_matrix = at(accel, "M");
    if (accel.has("M")) refuse(accel.at("M"), calibration.accel_matrix);
  }
  if (imu.has("gyroscopes") && imu.at("gyroscopes").isMap()) {
    const YamlField gyro = imu.at("gyroscopes");
    calibration.gyro_matrix = at(gyro, "M") * at(gyro, "C_gyro_i");
    if (gyro.has("M")) refuse(gyro.at("M"), calibration.gyro_matrix);
    if (gyro.has("A")) calibration.gyro_by_force = matrixOf(gyro.at("A"));
  }
  // OpenVINS uses other names for the same matrices.
  if (imu.has("Ta") || imu.has("R_IMUtoACC")) {
    calibration.accel_matrix = at(imu, "Ta") * at(imu, "R_IMUtoACC");
    refuse(imu.at(imu.has("Ta") ? "Ta" : "R_IMUtoACC"), calibration.accel_matrix);
  }
  if (imu.has("Tw") || imu.has("R_IMUtoGYRO")) {
    calibration.gyro_matrix = at(imu, "Tw") * at(imu, "R_IMUtoGYRO");
    refuse(imu.at(imu.has("Tw") ? "Tw" : "R_IMUtoGYRO"), calibration.gyro_matrix);
  }
  if (imu.has("Tg")) calibration.gyro_by_force = matrixOf(imu.at("Tg"));
  // Rounded products of identities count as the identity.
  if (calibration.gyro_matrix.isIdentity(kRounding)) calibration.gyro_matrix.setIdentity();
  if (calibration.accel_matrix.isIdentity(kRounding)) calibration.accel_matrix.setIdentity();
  if (imu.has("T_i_b")) {
    const YamlField field = imu.at("T_i_b");
    if (distance(readTransform(field, calibration.warnings), SE3()) > kContradiction) {
      throw field.error("this IMU is not the body (imu0)",
                        "Give the entry of imu0, whose T_i_b is the identity");
    }
  }
  if (imu.has("time_offset")) {
    const YamlField field = imu.at("time_offset");
    if (std::abs(field.number()) > kContradiction) {
      throw field.error("an offset between IMUs is not supported", "Give the entry of imu0");
    }
  }
}

CameraChain readCameraChain(const std::string& file) {
  const std::string text = openFolder("")->text(file);
  const YamlField root = YamlField::parse(file, text);
  Calibration calibration;
  CameraChain cameras;
  const YamlField first = root.at("cam0", "Give a Kalibr camchain file");
  cameras.has_imu = first.has("T_cam_imu") || first.has("T_imu_cam");
  CalibrationOptions options;
  options.accept_unusual_rig = !cameras.has_imu;  // without an IMU, the body is not the IMU's
  assembleRig(readChain(root, !cameras.has_imu, calibration.warnings), options, calibration);
  cameras.rig = calibration.rig;
  return cameras;
}

ImuNoise readImuNoise(const std::string& file, std::vector<std::string>& left_out) {
  const std::string text = openFolder("")->text(file);
  const YamlField imu = parseImu({file, text});
  Warnings warnings;
  return readNoise(imu, imu.has("rate_hz") ? "rate_hz" : "update_rate", warnings, &left_out);
}

Calibration parseKalibrCalibration(const NamedText& camchain, const NamedText& imu,
                                   const CalibrationOptions& options) {
  Calibration calibration;
  calibration.form = "Kalibr";
  const YamlField chain_root = YamlField::parse(camchain.name, camchain.text);
  const std::vector<CameraEntry> entries = readChain(chain_root, false, calibration.warnings);
  const YamlField imu_root = YamlField::parse(imu.name, imu.text);
  const YamlField imu_fields = imu_root.has("imu0") ? imu_root.at("imu0") : imu_root;
  readImuModel(imu_fields, calibration);
  if (imu_fields.has("rostopic")) calibration.imu_topic = imu_fields.at("rostopic").text();
  calibration.noise = readNoise(imu_fields, "update_rate", calibration.warnings);
  assembleRig(entries, options, calibration);
  return calibration;
}

}  // namespace swiftlet
