#pragma once
// What the stamps of a camera and its images alone tell: images left out, doubled, and brightness that jumps.

#include <vector>

#include "estimator/core/stamp.hpp"
#include "firmware_host/inspection/camera_tracks.hpp"
#include "firmware_host/inspection/finding.hpp"

namespace swiftlet {

/// `stamps`: of all images of camera 0, as far as the log was looked at.
std::vector<Finding> imageFindings(const std::vector<Stamp>& stamps, const std::vector<TrackedImage>& images);

/// The stamps on a clock that ticks evenly: of each stretch without gaps, the line through its stamps.
std::vector<Stamp> evenStamps(const std::vector<Stamp>& stamps);

}  // namespace swiftlet
