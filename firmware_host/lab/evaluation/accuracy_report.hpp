#pragma once
// Accuracy figures as JSON for summary.json and as lines for the terminal. Every number comes with its
// alignment, association tolerance and number of pairs.

#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/evaluation/accuracy.hpp"
#include "firmware_host/lab/evaluation/common_stamps.hpp"
#include "firmware_host/lab/evaluation/consistency.hpp"
#include "firmware_host/lab/evaluation/loop_accuracy.hpp"
#include "firmware_host/lab/evaluation/position_accuracy.hpp"
#include "firmware_host/lab/evaluation/revisits.hpp"

namespace swiftlet {

nlohmann::ordered_json toJson(const Accuracy& accuracy);
nlohmann::ordered_json toJson(const Consistency& consistency);
/// Compares map.tum with odometry.tum, the reference.
nlohmann::ordered_json toJson(const CommonStamps& map_beside_odometry);
nlohmann::ordered_json toJson(const Revisits& revisits);
nlohmann::ordered_json toJson(const LoopAccuracy& loops);
nlohmann::ordered_json toJson(const PositionAccuracy& accuracy);

/// `title`: section and file, for example "odometry.tum, from 3 s".
std::string toText(const std::string& title, const Accuracy& accuracy);
std::string toText(const std::string& title, const PositionAccuracy& accuracy);
std::string toText(const Consistency& consistency);
std::string toText(const CommonStamps& map_beside_odometry);
std::string toText(const Revisits& revisits);
std::string toText(const LoopAccuracy& loops);

}  // namespace swiftlet
