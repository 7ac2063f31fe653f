#pragma once
// Accuracy figures as JSON for summary.json and as lines for the terminal. Every number stands beside
// the alignment, the association tolerance and the number of pairs it was made from.

#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/evaluation/accuracy.hpp"
#include "firmware_host/evaluation/consistency.hpp"

namespace swiftlet {

nlohmann::ordered_json toJson(const Accuracy& accuracy);
nlohmann::ordered_json toJson(const Consistency& consistency);

/// `title`: which section and file, "odometry.tum, from 3 s".
std::string toText(const std::string& title, const Accuracy& accuracy);
std::string toText(const Consistency& consistency);

}  // namespace swiftlet
