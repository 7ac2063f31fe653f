#pragma once
// A bag that is there as a whole or not at all, in any of the forms that swiftlet writes.

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "drivers/bag/message_bag.hpp"

namespace swiftlet {

enum class BagForm : std::uint8_t { kRos1, kMcap, kRosbag2 };

/// `fill` writes the messages; gives their counts by topic. kRosbag2 makes a folder, which must not be there
/// yet. InputError of `fill`, and where the bag cannot be written; nothing is left of it then.
std::map<std::string, std::uint64_t> writeBag(BagForm form, const std::string& path,
                                              const std::function<void(MessageBag&)>& fill);

}  // namespace swiftlet
