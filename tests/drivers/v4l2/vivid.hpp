#pragma once
// Handles of the kernel's test camera: its controls by their names, as `v4l2-ctl --list-ctrls` gives them.

#include <string>

namespace swiftlet::vivid {

/// Sets a control; a button is pressed. Fails the test when there is no such control or it is refused.
void set(const std::string& path, const std::string& control, int value);
/// As set, with a string into a file of sysfs.
void write(const std::string& file, const std::string& text);
/// The luma range of the current format: true where 16 to 235 stand for black and white.
bool limitedRange(const std::string& path);
/// Waits in steps of 10 ms until the node is there; false after `ms`.
bool waitForNode(const std::string& path, int ms);

}  // namespace swiftlet::vivid
