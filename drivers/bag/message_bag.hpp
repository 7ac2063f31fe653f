#pragma once
// Writes typed messages into a bag of any kind. A topic is added with its definition at its first message.

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/bag/bag_writer.hpp"
#include "drivers/bag/message_coder.hpp"
#include "drivers/bag/message_text.hpp"

namespace swiftlet {

class MessageBag {
 public:
  explicit MessageBag(std::unique_ptr<BagWriter> writer) : writer_(std::move(writer)) {}

  /// True if the bag's messages can hold the stamp: from 1 ns to 2106 (ROS 1) or 2038 (ROS 2).
  [[nodiscard]] bool holds(Stamp stamp) const {
    const std::int64_t seconds = stamp.ns / rosmsg::kNsPerSecond;
    return stamp.ns > 0 &&
           (writer_->encoding() == BagEncoding::kRos1 ? seconds < std::numeric_limits<std::uint32_t>::max()
                                                      : seconds < std::numeric_limits<std::int32_t>::max());
  }

  /// Call in the order of the stamps. A header's `seq` counts the messages of its topic. `latched`: players
  /// repeat the topic's last message to late subscribers.
  template <rosmsg::Message T>
  void write(const std::string& name, Stamp stamp, T message, bool latched = false) {
    const auto [place, is_new] = topics_.try_emplace(name);
    Topic& topic = place->second;
    if (is_new) {
      topic.number =
          writer_->addTopic({name, T::kType, definitionOf<T>(writer_->encoding()), T::kMd5, latched});
    }
    const auto sequence = static_cast<std::uint32_t>(topic.messages++);
    if constexpr (requires { message.header.seq; }) message.header.seq = sequence;
    encode(message, writer_->encoding(), body_);
    writer_->write(topic.number, stamp, sequence, body_);
  }

  void finish() { writer_->finish(); }

  /// Number of messages by topic name.
  [[nodiscard]] std::map<std::string, std::uint64_t> counts() const {
    std::map<std::string, std::uint64_t> counts;
    for (const auto& [name, topic] : topics_) counts[name] = topic.messages;
    return counts;
  }

 private:
  struct Topic {
    std::uint32_t number = 0;
    std::uint64_t messages = 0;
  };

  std::unique_ptr<BagWriter> writer_;
  std::map<std::string, Topic> topics_;
  std::vector<std::uint8_t> body_;
};

}  // namespace swiftlet
