#pragma once
// Findings from a camera's stamps and images alone: missing and doubled images, and brightness jumps.

#include <vector>

#include "estimator/core/stamp.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"
#include "firmware_host/inspection/finding.hpp"

namespace swiftlet {

/// `stamps`: of all inspected images of camera 0.
std::vector<Finding> imageFindings(const std::vector<Stamp>& stamps, const std::vector<TrackedImage>& images);

/// The stamps on an even clock: for each stretch without gaps, the line fitted to its stamps.
std::vector<Stamp> evenStamps(const std::vector<Stamp>& stamps);

}  // namespace swiftlet
