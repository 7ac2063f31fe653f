#pragma once
// The recorded logs that whole-run tests use: a short one of the repository itself, long ones in the
// folder that SWIFTLET_DATA names, else in ../shared/data beside the source tree.

#include <optional>
#include <string>

namespace swiftlet {

/// The log's folder; empty, with a line on stderr, when it is not there.
std::optional<std::string> findLog(const std::string& name);

/// Four seconds of a real flight that are part of the repository: always there.
std::string shortLog();

}  // namespace swiftlet
