#include "drivers/dds/dds_domain.hpp"

#include <dds/dds.h>
#include <net/if.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <mutex>

namespace swiftlet {
namespace {

/// The library throttles a writer above this many unacknowledged bytes: set to more than it can ever keep.
constexpr const char* kWatermark = "1 GB";
/// The kernel's receive buffer: 25 images of 640x480. The kernel grants at most net.core.rmem_max.
constexpr const char* kReceiveBuffer = "10 MB";

std::string configuration(const DdsNetwork& network) {
  const bool loopback = network.interface == "lo";
  std::string text = "<General><Interfaces><NetworkInterface name=\"" + network.interface +
                     "\"/></Interfaces><AllowMulticast>" + (loopback ? "false" : "spdp") +
                     "</AllowMulticast></General><Internal><MaxSampleSize>" +
                     std::to_string(kLargestMessage) +
                     " B</MaxSampleSize><SocketReceiveBufferSize min=\"default\" max=\"" + kReceiveBuffer +
                     "\"/><Watermarks><WhcHigh>" + kWatermark + "</WhcHigh></Watermarks></Internal>";
  // Without multicast, programs that start later are found only by unicast discovery on this computer.
  if (loopback) {
    text +=
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32"
        "</MaxAutoParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers><SPDPInterval>1 "
        "s</SPDPInterval></Discovery>";
  }
  return text;
}

/// Shared by all domains: the library has one log sink.
struct Complaints {
  std::atomic<std::uint64_t> lines{0};
  std::atomic<void (*)(std::string_view)> tell{nullptr};
};
Complaints& allComplaints() {
  static Complaints all;
  return all;
}

/// Passes on only the first few lines: every message that is too large produces one.
void complain(void* to, const dds_log_data_t* data) {
  constexpr std::uint64_t kTold = 8;
  auto& all = *static_cast<Complaints*>(to);
  if (all.lines.fetch_add(1, std::memory_order_relaxed) >= kTold) return;
  if (auto* const tell = all.tell.load(std::memory_order_relaxed)) tell(data->message);
}

/// Comma-separated names of the network interfaces; sets `found` if `wanted` is one of them.
std::string interfaces(const std::string& wanted, bool& found) {
  std::string names;
  found = false;
  struct if_nameindex* const list = if_nameindex();
  for (const struct if_nameindex* it = list; it != nullptr && it->if_name != nullptr; ++it) {
    names += (names.empty() ? "" : ", ") + std::string(it->if_name);
    found = found || wanted == it->if_name;
  }
  if (list != nullptr) if_freenameindex(list);
  return names;
}

/// The open domains by number: the library opens each once per process.
struct OpenDomains {
  std::mutex mutex;
  std::map<std::uint32_t, std::weak_ptr<DdsDomain>> all;
};
OpenDomains& openDomains() {
  static OpenDomains open;
  return open;
}

/// DDS to ROS topic name ("/camera/imu" for "rt/camera/imu"); empty if it is not a ROS topic.
std::string rosTopic(std::string_view name) {
  return name.starts_with("rt/") ? std::string(name.substr(2)) : std::string();
}

/// DDS to ROS type name, of "sensor_msgs::msg::dds_::Imu_".
std::string rosType(std::string_view type) {
  std::string text(type);
  if (const std::size_t at = text.find("dds_::"); at != std::string::npos) text.erase(at, 6);
  if (text.ends_with('_')) text.pop_back();
  for (std::size_t at = 0; (at = text.find("::", at)) != std::string::npos;) text.replace(at, 2, "/");
  return text;
}

}  // namespace

std::shared_ptr<DdsDomain> DdsDomain::open(const DdsNetwork& network, std::string& error) {
  OpenDomains& domains = openDomains();
  const std::lock_guard lock(domains.mutex);
  std::weak_ptr<DdsDomain>& place = domains.all[network.domain];
  const std::string number = std::to_string(network.domain);
  if (network.complain != nullptr) {
    allComplaints().tell.store(network.complain, std::memory_order_relaxed);
  }
  if (std::shared_ptr<DdsDomain> there = place.lock()) {
    if (there->interface_ == network.interface) return there;
    error = "DDS domain " + number + " is open on the network interface " + there->interface_ + " already";
    return nullptr;
  }
  bool found = false;
  const std::string names = interfaces(network.interface, found);
  if (!found) {
    error = "there is no network interface '" + network.interface + "', only " + names;
    return nullptr;
  }
  dds_set_log_sink(complain, &allComplaints());
  std::shared_ptr<DdsDomain> made(new DdsDomain());
  const auto failed = [&](const std::string& what, std::int32_t result) {
    error = what + " (" + dds_strretcode(result) + ")";
    return nullptr;
  };
  made->interface_ = network.interface;
  made->domain_ = dds_create_domain(network.domain, configuration(network).c_str());
  if (made->domain_ < 0) {
    return failed("DDS domain " + number + " cannot be opened on the network interface " + network.interface +
                      ": it must be up and have an address",
                  made->domain_);
  }
  made->participant_ = dds_create_participant(network.domain, nullptr, nullptr);
  if (made->participant_ < 0) {
    return failed("DDS cannot take part in domain " + number + " on the network interface " +
                      network.interface + ": at most 32 programs per computer are supported",
                  made->participant_);
  }
  place = made;
  return made;
}

DdsDomain::~DdsDomain() {
  if (participant_ > 0) dds_delete(participant_);
  if (domain_ > 0) dds_delete(domain_);
}

std::vector<PublishedTopic> DdsDomain::publishedTopics() const {
  std::vector<PublishedTopic> topics;
  const dds_entity_t reader =
      dds_create_reader(participant_, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr);
  if (reader < 0) return topics;
  dds_guid_t own{};
  dds_get_guid(participant_, &own);
  constexpr std::size_t kAtOnce = 32;
  constexpr int kMostRounds = 64;  // bounds the time in domains with very many writers
  std::array<void*, kAtOnce> samples{};
  std::array<dds_sample_info_t, kAtOnce> infos{};
  for (int round = 0; round < kMostRounds; ++round) {
    const dds_return_t count = dds_take(reader, samples.data(), infos.data(), kAtOnce, kAtOnce);
    if (count <= 0) break;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      const auto& writer = *static_cast<const dds_builtintopic_endpoint_t*>(samples.at(i));
      const bool ours = std::ranges::equal(writer.participant_key.v, own.v);
      if (!infos.at(i).valid_data || ours) continue;
      const std::string name = rosTopic(writer.topic_name);
      if (!name.empty()) topics.push_back({name, rosType(writer.type_name)});
    }
    dds_return_loan(reader, samples.data(), count);
    samples = {};
  }
  dds_delete(reader);
  std::ranges::sort(topics, [](const PublishedTopic& a, const PublishedTopic& b) {
    return a.name != b.name ? a.name < b.name : a.type < b.type;
  });
  topics.erase(std::unique(topics.begin(), topics.end()), topics.end());
  return topics;
}

std::uint64_t DdsDomain::complaints() { return allComplaints().lines.load(std::memory_order_relaxed); }

dds_qos* topicQuality(bool reliable, int kept) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kept);
  dds_data_representation_id_t plain = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos, 1, &plain);
  return qos;
}

}  // namespace swiftlet
