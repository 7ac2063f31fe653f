#include "firmware_host/lab/calibrate/check/check_run.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "drivers/input/input_error.hpp"
#include "firmware_host/realtime/progress.hpp"
#include "firmware_host/runs/replay_run.hpp"
#include "firmware_host/smoothing/keyframe_reader.hpp"
#include "firmware_host/smoothing/map_keeper.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;
using change::kCount;

constexpr std::size_t kLongestPiece = 40;  // keyframes, some 8 s
constexpr std::size_t kShortestPiece = 15;
constexpr std::size_t kWantedPieces = 5;
constexpr std::size_t kMostPieces = 10;
constexpr std::size_t kFewestPieces = 3;  // fewer show no scatter
constexpr double kMostBetween = 1.0;      // s, between neighbouring keyframes

/// A folder for the run that is deleted afterwards unless the user named one.
class RunPlace {
 public:
  explicit RunPlace(const std::string& wanted) : path_(wanted), own_(wanted.empty()) {
    if (!own_) return;
    std::string name = (fs::temp_directory_path() / "swiftlet_check_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw InputError(name, 0, "", "cannot be created", "Give a folder with --out");
    }
    path_ = name;
  }
  ~RunPlace() {
    std::error_code ignored;
    if (own_) fs::remove_all(path_, ignored);
  }
  RunPlace(const RunPlace&) = delete;
  RunPlace& operator=(const RunPlace&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
  bool own_;
};

using Keyframes = std::vector<FlightKeyframe>;

/// Reads stretches of consecutive keyframes.
std::vector<Keyframes> readStretches(KeyframeReader& reader) {
  std::vector<Keyframes> stretches;
  std::vector<ImuSample> samples;
  for (auto next = reader.next(); next != KeyframeReader::Next::kEnd; next = reader.next()) {
    if (next == KeyframeReader::Next::kSample) samples.push_back(reader.sample());
    if (next != KeyframeReader::Next::kKeyframe) continue;
    FlightKeyframe keyframe{reader.frame(), reader.state(), reader.noiseInUse(), samples};
    // The next interval begins at this frame; some earlier samples are kept for a time shift.
    const Stamp keep = keyframe.frame.stamp - Duration::fromMilliseconds(100);
    std::erase_if(samples, [&](const ImuSample& sample) { return sample.stamp < keep; });
    if (stretches.empty() || stretches.back().back().state.epoch != keyframe.state.epoch ||
        (keyframe.frame.stamp - stretches.back().back().frame.stamp).seconds() > kMostBetween) {
      stretches.emplace_back();
    }
    stretches.back().push_back(std::move(keyframe));
  }
  return stretches;
}

/// At most kMostPieces of equal length, spread over the flight. Short flights have short pieces, so that
/// there are enough for a scatter.
std::vector<Keyframes> cut(const std::vector<Keyframes>& stretches) {
  std::size_t total = 0;
  for (const Keyframes& stretch : stretches) total += stretch.size();
  const std::size_t length = std::clamp(total / kWantedPieces, kShortestPiece, kLongestPiece);
  std::vector<Keyframes> pieces;
  for (const Keyframes& stretch : stretches) {
    for (std::size_t begin = 0; begin + length <= stretch.size(); begin += length) {
      const auto from = stretch.begin() + static_cast<std::ptrdiff_t>(begin);
      pieces.emplace_back(from, from + static_cast<std::ptrdiff_t>(length));
    }
  }
  if (pieces.size() <= kMostPieces) return pieces;
  std::vector<Keyframes> chosen;
  for (std::size_t i = 0; i < kMostPieces; ++i) chosen.push_back(pieces[i * pieces.size() / kMostPieces]);
  return chosen;
}

/// A checked quantity: a linear combination of the columns of the change.
struct Quantity {
  std::string name;
  std::string unit;
  CalibrationChange row = CalibrationChange::Zero();  ///< converts to `unit`
  double limit = 0;                                   ///< in `unit`
  double file = 0;
  double effect_per_unit = 0;
  std::string effect_unit = {};
  bool essential = true;
  double model_sigma = 0;  ///< in `unit`: IMU errors that no variable models
};

constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
// Limits: the larger of what costs accuracy and what calibrations by good tools differ by.
constexpr double kShiftLimit = 2;  // ms: 2 mrad at 1 rad/s
constexpr double kTurnLimit =
    0.15;                          // deg: two good tools differ by up to 0.3 on EuRoC's rig, 0.03 on TUM-VI's
constexpr double kMoveLimit = 20;  // mm: Kalibr and Basalt differ by 8
constexpr double kFocalLimit = 0.5;     // %
constexpr double kRigTurnLimit = 0.05;  // deg; the epipolar gate is 1.5 px, 0.19 deg of a 460 px lens
// The flight's scale comes from the accelerometer. Its misalignment and the scale change by warming up are
// not estimated: 0.02 %/K (MPU-6000, data sheet 3.4, 6.2) over 25 K.
constexpr double kLengthSigma = 0.5;                 // %
constexpr double kBaselineLimit = 3 * kLengthSigma;  // %; beyond what these errors alone cause
constexpr double kToDegrees = 180 / std::numbers::pi;
constexpr double kToMilli = 1e3;
constexpr double kPercent = 100;
// Ten flights have a hundred such quantities: chance alone must not raise an alarm in any.
constexpr double kAlarmSigmas = 4;
constexpr double kKnownSigmas = 2;  // of the limit, for "holds"
constexpr double kLeastStereoShare = 0.25;

std::vector<Quantity> quantitiesOf(const Rig& rig) {
  std::vector<Quantity> quantities;
  const double focal = rig.camera[0].focal();
  Quantity shift{"time shift of the cameras", "ms"};
  shift.row[change::kShift] = kToMilli;
  shift.limit = kShiftLimit;
  shift.file = kToMilli * rig.camera_to_imu_shift.seconds();
  shift.effect_per_unit = focal / kToMilli;
  shift.effect_unit = "px at 1 rad/s";
  quantities.push_back(shift);
  // A gyro whose axes are tilted by `a` reads (I + hat(a)) rate; for the images this is a rotation of the
  // camera by R_cam_body a. Flights determine the sum of both but hardly their shares.
  const Eigen::Matrix3d R_cam_body = rig.T_body_cam[0].R().transpose();
  for (int axis = 0; axis < 3; ++axis) {
    Quantity turn{
        fmt::format("camera 0 against the gyro: turn about its {}", kAxes.at(static_cast<std::size_t>(axis))),
        "deg"};
    turn.row[change::kTurn + axis] = kToDegrees;
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      const int k = (i + 2) % 3;
      const double half = 0.5 * kToDegrees * R_cam_body(axis, i);
      turn.row[change::kGyro + 3 * j + k] += half;  // hat(a)(k, j) = a_i
      turn.row[change::kGyro + 3 * k + j] -= half;
    }
    turn.limit = kTurnLimit;
    turn.effect_per_unit = focal / kToDegrees;
    turn.effect_unit = "px";
    quantities.push_back(turn);
  }
  for (std::size_t c = 0; c < rig.camera_count; ++c) {
    Quantity lens{fmt::format("camera {}: focal length", c), "%"};
    lens.row[change::kFocal + static_cast<int>(c)] = kPercent;
    lens.limit = kFocalLimit;
    lens.effect_per_unit = std::hypot(rig.camera[c].width(), rig.camera[c].height()) / 2 / kPercent;
    lens.effect_unit = "px at the rim";
    quantities.push_back(lens);
  }
  if (rig.camera_count > 1) {
    for (int axis = 0; axis < 3; ++axis) {
      Quantity turn{fmt::format("camera 1 against camera 0: turn about its {}",
                                kAxes.at(static_cast<std::size_t>(axis))),
                    "deg"};
      turn.row[change::kRigTurn + axis] = kToDegrees;
      turn.limit = kRigTurnLimit;
      turn.effect_per_unit = focal / kToDegrees;
      turn.effect_unit = "px";
      quantities.push_back(turn);
    }
    const double baseline = rig.baseline();
    const Eigen::Vector3d along = (rig.T_body_cam[0].inverse() * rig.T_body_cam[1]).translation / baseline;
    Quantity length{"baseline", "%"};
    length.row.segment<3>(change::kRigMove) = kPercent / baseline * along;
    length.limit = kBaselineLimit;
    length.model_sigma = kLengthSigma;
    length.effect_per_unit = baseline * kToMilli / kPercent;
    length.effect_unit = "mm";
    quantities.push_back(length);
  }
  for (int axis = 0; axis < 3; ++axis) {
    Quantity move{fmt::format("camera 0 on the body: position {}", kAxes.at(static_cast<std::size_t>(axis))),
                  "mm"};
    move.row[change::kMove + axis] = kToMilli;
    move.limit = kMoveLimit;
    move.file = kToMilli * rig.T_body_cam[0].translation[axis];
    move.effect_per_unit = 1;
    move.effect_unit = "mm";
    move.essential = false;
    quantities.push_back(move);
  }
  return quantities;
}

struct Sum {
  CalibrationChange change = CalibrationChange::Zero();
  ChangeMatrix covariance = ChangeMatrix::Zero();
};

/// Sum over all pieces except `without`; -1: all.
Sum together(const std::vector<PieceResult>& pieces, std::ptrdiff_t without) {
  const ChangeMatrix prior = changePriors().cwiseAbs2().cwiseInverse().asDiagonal();
  ChangeMatrix information = prior;
  CalibrationChange weighted = CalibrationChange::Zero();
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    if (static_cast<std::ptrdiff_t>(i) == without) continue;
    information += pieces[i].information;
    // A piece's change includes the effect of the priors.
    weighted += (pieces[i].information + prior) * pieces[i].change;
  }
  // Columns differ by many orders of magnitude.
  const CalibrationChange scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<ChangeMatrix> factor(scale.asDiagonal() * information * scale.asDiagonal());
  Sum sum;
  sum.covariance = scale.asDiagonal() * factor.solve(ChangeMatrix::Identity()) * scale.asDiagonal();
  sum.change = sum.covariance * weighted;
  return sum;
}

/// Results from the inner and the outer half of the image.
struct Parts {
  std::vector<PieceResult> inner;
  std::vector<PieceResult> outer;
};

struct Estimate {
  double value = 0;
  double variance = 0;
};

/// Uses the larger variance: the formal one or the jackknife's (leaving out each piece in turn), which shows
/// changes during the flight.
Estimate estimateOf(const Quantity& quantity, const std::vector<PieceResult>& pieces) {
  const Sum all = together(pieces, -1);
  const auto count = static_cast<double>(pieces.size());
  std::vector<double> others;
  double mean = 0;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    others.push_back(quantity.row.dot(together(pieces, static_cast<std::ptrdiff_t>(i)).change));
    mean += others.back() / count;
  }
  double scatter = 0;
  for (const double other : others) scatter += (other - mean) * (other - mean) * (count - 1) / count;
  return {quantity.row.dot(all.change), std::max(quantity.row.dot(all.covariance * quantity.row), scatter)};
}

/// Sets `disagree` if disagreement between the parts of the image prevents a verdict.
CheckedValue judge(const Quantity& quantity, const std::vector<PieceResult>& pieces, const Parts& parts,
                   bool& disagree) {
  CheckedValue value;
  value.name = quantity.name;
  value.unit = quantity.unit;
  value.file = quantity.file;
  value.limit = quantity.limit;
  value.essential = quantity.essential;
  const Estimate all = estimateOf(quantity, pieces);
  value.change = all.value;
  double variance = all.variance + quantity.model_sigma * quantity.model_sigma;
  // A lens model that does not fit gives different results in the middle and at the rim.
  if (parts.inner.size() >= kFewestPieces && parts.outer.size() >= kFewestPieces) {
    const Estimate inner = estimateOf(quantity, parts.inner);
    const Estimate outer = estimateOf(quantity, parts.outer);
    const double apart = inner.value - outer.value;
    variance += std::max(0.0, apart * apart - inner.variance - outer.variance) / 4;
  }
  value.sigma = std::sqrt(variance);
  value.effect =
      fmt::format("{:.2g} {}", std::abs(value.change) * quantity.effect_per_unit, quantity.effect_unit);
  const double size = std::abs(value.change);
  if (size > value.limit && size > kAlarmSigmas * value.sigma) {
    value.verdict = CheckVerdict::kMoved;
  } else if (size > value.limit || kKnownSigmas * value.sigma > value.limit) {
    value.verdict = CheckVerdict::kCannotTell;
    disagree |= quantity.essential && quantity.model_sigma == 0 && variance > 2 * all.variance;
  } else {
    value.verdict = CheckVerdict::kHolds;
  }
  return value;
}

void conclude(bool disagree, CheckResult& result) {
  bool moved = false;
  std::string unknown;
  for (const CheckedValue& value : result.values) {
    if (value.verdict == CheckVerdict::kMoved) {
      moved = true;
      result.because.push_back(fmt::format("{} has changed by {:+.3g} {} ({:.1f} sigma, {}): recalibrate.",
                                           value.name, value.change, value.unit,
                                           std::abs(value.change) / value.sigma, value.effect));
    }
    if (value.verdict == CheckVerdict::kCannotTell && value.essential) {
      unknown += fmt::format("{}{} ({:+.2g} +- {:.2g} {})", unknown.empty() ? "" : ", ", value.name,
                             value.change, value.sigma, value.unit);
    }
  }
  const bool two = result.rig.camera_count > 1;
  const bool few_stereo = two && result.stereo_share < kLeastStereoShare;
  if (few_stereo) {
    result.because.push_back(
        fmt::format("Only {:.0f} % of the points are found by both cameras: the cameras may have rotated "
                    "relative to each other beyond the search range, or see different scenes.",
                    kPercent * result.stereo_share));
  }
  if (!unknown.empty()) {
    result.because.push_back("This flight does not determine: " + unknown + ". " +
                             (disagree
                                  ? "The centre and the rim of the image disagree by more than noise: the "
                                    "lens model does not fit the images. Check the residuals over the image, "
                                    "and recalibrate the cameras if the accuracy has become worse."
                                  : "Fly longer, with rotations about all axes and quick changes of speed."));
  }
  result.verdict = moved                            ? CheckVerdict::kMoved
                   : few_stereo || !unknown.empty() ? CheckVerdict::kCannotTell
                                                    : CheckVerdict::kHolds;
}

}  // namespace

const char* name(CheckVerdict verdict) {
  switch (verdict) {
    case CheckVerdict::kHolds:
      return "holds";
    case CheckVerdict::kMoved:
      return "has moved";
    case CheckVerdict::kCannotTell:
      break;
  }
  return "cannot tell";
}

CheckResult checkCalibration(const CheckRequest& request, Settings settings) {
  CheckResult result;
  result.log = request.log;
  const RunPlace place(request.out);
  settings.odometry.estimate_time_offset = true;
  settings.odometry.estimate_extrinsics = true;
  ReplayRequest replay;
  static_cast<LogRequest&>(replay) = request;
  replay.out = place.path();
  static_cast<void>(runReplay(replay, settings));
  const std::string path = (fs::path(place.path()) / kKeyframeFile).string();
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    result.because.push_back(
        "The estimator produced no usable flight from this log: check it with `swiftlet doctor`.");
    return result;
  }
  KeyframeReader reader(path, in);
  result.rig = reader.rig();
  Parts parts;
  double points = 0;
  double stereo = 0;
  const auto add = [&](const Keyframes& keyframes, ImagePart part, std::vector<PieceResult>& to) {
    PieceResult piece = solvePiece(result.rig, reader.noise(), keyframes, part);
    if (piece.solved) to.push_back(std::move(piece));
  };
  const std::vector<Keyframes> pieces = cut(readStretches(reader));
  Progress progress("checking calibration", request.show_progress ? pieces.size() : 0);
  for (std::size_t i = 0; i < pieces.size() && !request.stopped(); ++i) {
    add(pieces[i], ImagePart::kAll, result.pieces);
    add(pieces[i], ImagePart::kInner, parts.inner);
    add(pieces[i], ImagePart::kOuter, parts.outer);
    progress.update(i + 1);
  }
  progress.finish();
  if (result.pieces.size() < kFewestPieces) {
    result.because.push_back(fmt::format(
        "The estimator ran {} pieces of this log well enough, {} are required: check it with `swiftlet "
        "doctor` and `swiftlet replay`. A calibration that is far off can also cause this.",
        result.pieces.size(), kFewestPieces));
    return result;
  }
  for (const PieceResult& piece : result.pieces) {
    points += static_cast<double>(piece.points);
    stereo += static_cast<double>(piece.stereo_points);
  }
  result.stereo_share = stereo / points;
  bool disagree = false;
  for (const Quantity& quantity : quantitiesOf(result.rig)) {
    result.values.push_back(judge(quantity, result.pieces, parts, disagree));
  }
  conclude(disagree, result);
  return result;
}

std::string checkText(const CheckResult& result) {
  std::string text = fmt::format("{:<48} {:>10} {:>14} {:>9} {:>8} {:<4}  {:<24} {}\n", "", "file",
                                 "flight - file", "1 sigma", "limit", "unit", "effect", "verdict");
  if (result.values.empty()) text.clear();
  for (const CheckedValue& value : result.values) {
    text += fmt::format("{:<48} {:>10.4g} {:>+14.3g} {:>9.2g} {:>8.3g} {:<4}  {:<24} {}\n", value.name,
                        value.file, value.change, value.sigma, value.limit, value.unit, value.effect,
                        name(value.verdict));
  }
  text += fmt::format("{}: the calibration {}\n", result.log,
                      result.verdict == CheckVerdict::kCannotTell ? "cannot be checked with this flight"
                                                                  : name(result.verdict));
  for (const std::string& line : result.because) text += "  " + line + "\n";
  return text;
}

}  // namespace swiftlet
