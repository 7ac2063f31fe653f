#pragma once
// Writes a bag completely or not at all, in any of the forms that swiftlet supports.

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "drivers/bag/message_bag.hpp"

namespace swiftlet {

enum class BagForm : std::uint8_t { kRos1, kMcap, kRosbag2 };

/// `fill` writes the messages. Returns their counts by topic. kRosbag2 creates a folder, which must not
/// exist. Rethrows InputError of `fill`; InputError if the bag cannot be written. Nothing is left of it then.
std::map<std::string, std::uint64_t> writeBag(BagForm form, const std::string& path,
                                              const std::function<void(MessageBag&)>& fill);

}  // namespace swiftlet
