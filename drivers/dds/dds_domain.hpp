#pragma once
// A DDS domain that this program has joined, shared by all its publishers and subscribers in it.
//
// Network: loopback and unicast unless `interface` names another. Messages above kLargestMessage are neither
// sent nor received. Threads: any. The library has its own threads, which inherit the scheduling of the
// thread that first opened the domain. Errors: text for the user. In builds without SWIFTLET_WITH_DDS, open()
// always fails and says so.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

struct dds_qos;

namespace swiftlet {

inline constexpr std::size_t kLargestMessage = std::size_t{16} * 1024 * 1024;

struct DdsNetwork {
  std::uint32_t domain = 0;      ///< ROS_DOMAIN_ID, 0 to 232
  std::string interface = "lo";  ///< network interface; "lo": this computer only
  /// Receives the first lines of the library's warnings and errors, from any of its threads; null: none. The
  /// setting of the domain opened last applies to all, since the library has one sink.
  void (*complain)(std::string_view line) = nullptr;
};

/// A published topic by its ROS names: "/camera/imu", "sensor_msgs/msg/Imu".
struct PublishedTopic {
  std::string name;
  std::string type;
  bool operator==(const PublishedTopic&) const = default;
};

class DdsDomain {
 public:
  /// Returns the open domain if there is one. Null, with `error`, if it cannot be opened.
  [[nodiscard]] static std::shared_ptr<DdsDomain> open(const DdsNetwork& network, std::string& error);
  ~DdsDomain();
  DdsDomain(const DdsDomain&) = delete;
  DdsDomain& operator=(const DdsDomain&) = delete;

  /// The library's handle of our participant.
  [[nodiscard]] std::int32_t participant() const { return participant_; }
  /// Topics published by other programs, as discovered so far, sorted by name.
  [[nodiscard]] std::vector<PublishedTopic> publishedTopics() const;
  /// Number of warnings and errors of the library so far; a message that is too large gives one.
  [[nodiscard]] static std::uint64_t complaints();

 private:
  DdsDomain() = default;

  std::string interface_;
  std::int32_t domain_ = 0;
  std::int32_t participant_ = 0;
};

/// Quality of service as in ROS 2: reliable or best effort, volatile, the last `kept` messages; writers never
/// wait. Delete it with dds_delete_qos().
[[nodiscard]] dds_qos* topicQuality(bool reliable, int kept);

}  // namespace swiftlet
