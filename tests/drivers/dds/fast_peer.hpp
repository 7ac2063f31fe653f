#pragma once
// A participant of another make: eProsima Fast DDS, with ROS 2's names of topics and qualities of service.

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <cstdint>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <memory>
#include <string>

#include "ros_messagesPubSubTypes.h"  // made by fastddsgen from ros_messages.idl

namespace swiftlet::test {

namespace fast = eprosima::fastdds::dds;

/// Calls `take(message)` for every message.
template <typename Message, typename Take>
class Listener : public fast::DataReaderListener {
 public:
  explicit Listener(Take take) : take_(std::move(take)) {}
  void on_data_available(fast::DataReader* reader) override {
    fast::SampleInfo info;
    while (reader->take_next_sample(&message_, &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) take_(message_);
    }
  }

 private:
  Message message_;
  Take take_;
};

template <typename Message, typename Take>
Listener<Message, Take> listener(Take take) {
  return Listener<Message, Take>(std::move(take));
}

inline std::uint64_t nanosecondsOf(const std_msgs::msg::dds_::Header_& header) {
  return static_cast<std::uint64_t>(header.stamp().sec()) * 1'000'000'000 + header.stamp().nanosec();
}

class Peer {
 public:
  /// `depth`: messages of a topic that its readers keep; ROS 2's subscriptions keep ten by default. Those of
  /// a burst beyond it are lost at the reader, whatever the writer keeps.
  explicit Peer(std::uint32_t domain, int depth = 10) : depth_(depth) {
    // As ROS 2 does it for processes that stay on one computer.
    const auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.emplace_back("127.0.0.1");
    fast::DomainParticipantQos qos = fast::PARTICIPANT_QOS_DEFAULT;
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(loopback);
    participant_ = fast::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
    if (participant_ == nullptr) std::abort();
    subscriber_ = participant_->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
  }
  ~Peer() {
    participant_->delete_contained_entities();
    fast::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  template <typename Type>
  fast::Topic* topic(const std::string& name) {
    fast::TypeSupport type(new Type());
    type.register_type(participant_);
    return participant_->create_topic("rt" + name, type.get_type_name(), fast::TOPIC_QOS_DEFAULT);
  }
  /// As a subscription of ROS 2 is by default: reliable, volatile.
  template <typename Type>
  void read(const std::string& name, fast::DataReaderListener& listener) {
    fast::DataReaderQos qos = fast::DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
    qos.history().depth = depth_;
    if (subscriber_->create_datareader(topic<Type>(name), qos, &listener) == nullptr) std::abort();
  }
  template <typename Type>
  fast::DataWriter* writer(const std::string& name, bool reliable = true) {
    fast::DataWriterQos qos = fast::DATAWRITER_QOS_DEFAULT;
    qos.reliability().kind = reliable ? fast::RELIABLE_RELIABILITY_QOS : fast::BEST_EFFORT_RELIABILITY_QOS;
    qos.history().depth = 10;
    return participant_->create_publisher(fast::PUBLISHER_QOS_DEFAULT)
        ->create_datawriter(topic<Type>(name), qos);
  }

 private:
  int depth_;
  fast::DomainParticipant* participant_;
  fast::Subscriber* subscriber_;
};

}  // namespace swiftlet::test
