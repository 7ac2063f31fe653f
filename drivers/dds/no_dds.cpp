// Replaces dds_domain.cpp and topic_reader.cpp in builds without Cyclone DDS.

#include <memory>
#include <string>

#include "drivers/dds/topic_reader.hpp"

namespace swiftlet {

std::shared_ptr<DdsDomain> DdsDomain::open(const DdsNetwork& /*network*/, std::string& error) {
  error =
      "built without DDS: install cyclonedds-dev and cyclonedds-tools, configure with -DSWIFTLET_WITH_DDS=ON "
      "and build again";
  return nullptr;
}
DdsDomain::~DdsDomain() = default;
std::vector<PublishedTopic> DdsDomain::publishedTopics() const { return {}; }
std::uint64_t DdsDomain::complaints() { return 0; }

struct TopicReader::Entities {};
TopicReader::TopicReader() = default;
TopicReader::~TopicReader() = default;
bool TopicReader::open(std::shared_ptr<DdsDomain> /*domain*/, TopicType /*type*/, const std::string& /*name*/,
                       const TopicBell& /*bell*/, std::string& error) {
  error = "built without DDS";
  return false;
}
bool TopicReader::take(TopicImage& /*image*/) { return false; }
bool TopicReader::take(TopicImu& /*sample*/) { return false; }
bool TopicReader::take(CameraInfo& /*info*/) { return false; }
int TopicReader::publishers() const { return 0; }
TopicCounters TopicReader::counters() const { return {}; }

}  // namespace swiftlet
