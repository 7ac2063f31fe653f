#pragma once
// Checks from a flight without a board whether a calibration still holds: implements `swiftlet calibrate
// check`.
//
// The estimator runs on the log with its own refinement of the calibration enabled. Its keyframes are cut
// into pieces, and each piece estimates the calibration (flight_piece.hpp). The information of the pieces is
// added; their scatter, from leaving each out in turn, gives the uncertainty of the sum. Method, limits and
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
  double file = 0;    ///< what the calibration says; of rotations 0: their change is what counts
  double change = 0;  ///< what the flight says, less that
  double sigma = 0;
  double limit = 0;       ///< a change of this size costs accuracy
  bool essential = true;  ///< false: flights do not feel it, and it may stay unknown
  std::string effect;     ///< of the change: pixels at the image's rim, millimetres
  CheckVerdict verdict = CheckVerdict::kCannotTell;
};

struct CheckResult {
  CheckVerdict verdict = CheckVerdict::kCannotTell;
  std::vector<std::string> because;  ///< a sentence each, with its remedy
  std::vector<CheckedValue> values;
  std::vector<PieceResult> pieces;
  Rig rig;                  ///< as the file has it
  double stereo_share = 0;  ///< of the points, seen by both cameras
  std::string log;
};

struct CheckRequest : LogRequest {
  std::string out;  ///< folder for the run; empty: one that is removed afterwards
};

/// InputError if the log or its calibration cannot be read.
CheckResult checkCalibration(const CheckRequest& request, Settings settings);

std::string checkText(const CheckResult& result);

}  // namespace swiftlet
