#pragma once
// loops.csv of a run folder: one row per geometrically verified loop, in the order of detection, with the
// final verdict of the selection. Stamps [ns] are those of the keyframes' images; T_old_new is between the
// bodies, quaternion xyzw; standard deviations are of the worst direction of rotation [rad] and translation
// [m].

#include <span>
#include <string>
#include <vector>

#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {

/// "selected", "against_odometry", ...
std::string_view verdictName(LoopVerdict verdict);

/// Replaces the file.
void writeLoops(const std::string& path, std::span<const MapLoop> loops);

/// InputError naming file and line.
std::vector<MapLoop> readLoops(const std::string& path);

}  // namespace swiftlet
