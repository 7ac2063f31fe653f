#pragma once
// The settings tree of the program: one typed value, defaults as its members say.
//
// Each setting is declared once more, in registry.cpp, with key, unit, bounds and explanation; the
// reader, the printer and the checks work from that table alone.

#include "estimator/messages/effort.hpp"
#include "estimator/odometry/odometry_settings.hpp"

namespace swiftlet {

struct PairingGroup {
  double tolerance_ms = 2.5;
  double patience_ms = 50;
};

struct CalibrationGroup {
  bool accept_unusual_rig = false;
};

struct EvaluationGroup {
  double max_gap_ms = 20;
  double rpe_delta_s = 1.0;
};

struct Settings {
  OdometrySettings odometry;
  Effort effort;
  PairingGroup pairing;
  CalibrationGroup calibration;
  EvaluationGroup evaluation;
  bool full_smoothing = true;  ///< smoother.horizon is `full`
};

}  // namespace swiftlet
