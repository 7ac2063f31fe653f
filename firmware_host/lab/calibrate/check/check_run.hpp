#pragma once
// Checks from a flight without a board whether a calibration still holds: implements `swiftlet calibrate
// check`.
//
// The estimator runs on the log with its own calibration refinement enabled. Its keyframes are cut into
// pieces, and each piece estimates the calibration (flight_piece.hpp). The information of the pieces is
// added; the uncertainty of the sum comes from their scatter, by leaving each out in turn. Method, limits and
// their reasons: docs/calibration.md. Off the flight path.

#include <array>
#include <string>
#include <vector>

#include "firmware_host/inputs/log/log_request.hpp"
#include "firmware_host/lab/calibrate/check/flight_piece.hpp"
#include "firmware_host/settings/settings.hpp"

namespace swiftlet {

enum class CheckVerdict : std::uint8_t { kHolds, kMoved, kCannotTell };
const char* name(CheckVerdict verdict);

struct CheckedValue {
  std::string name;
  std::string unit;
  double file = 0;    ///< value in the calibration; 0 for rotations, of which only the change matters
  double change = 0;  ///< the flight's value minus the calibration's
  double sigma = 0;
  double limit = 0;       ///< a change of this size costs accuracy
  bool essential = true;  ///< false: flights are not sensitive to it, so it may stay unknown
  std::string effect;     ///< effect of the change: pixels at the image's rim, millimetres
  CheckVerdict verdict = CheckVerdict::kCannotTell;
};

struct CheckResult {
  CheckVerdict verdict = CheckVerdict::kCannotTell;
  std::vector<std::string> because;  ///< one sentence each, with its remedy
  std::vector<CheckedValue> values;
  std::vector<PieceResult> pieces;
  Rig rig;                  ///< as in the file
  double stereo_share = 0;  ///< share of points seen by both cameras
  std::string log;
};

struct CheckRequest : LogRequest {
  std::string out;  ///< folder for the run; empty: a temporary one
};

/// InputError if the log or its calibration cannot be read.
CheckResult checkCalibration(const CheckRequest& request, Settings settings);

std::string checkText(const CheckResult& result);

}  // namespace swiftlet
