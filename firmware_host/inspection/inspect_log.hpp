#pragma once
// Inspection of a recorded log, which is opened separately so that the following run is not affected.

#include <cstddef>

#include "firmware_host/inputs/log/log_request.hpp"
#include "firmware_host/inspection/inspection.hpp"

namespace swiftlet {

/// Inspects the requested section. InputError if the log cannot be read.
InspectionReport inspectLog(const LogRequest& request, const Settings& settings, std::size_t most_images);

}  // namespace swiftlet
