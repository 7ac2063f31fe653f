#include "drivers/bag/ros1_file.hpp"

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <cstring>
#include <exception>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

/// A message of any type as bytes; the traits below give its type when rosbag first sees a topic.
struct RawMessage {
  const BagWriterTopic* topic = nullptr;
  std::span<const std::uint8_t> body;
};

}  // namespace
}  // namespace swiftlet

namespace ros {
namespace message_traits {
template <>
struct MD5Sum<swiftlet::RawMessage> {
  static const char* value(const swiftlet::RawMessage& message) { return message.topic->md5.c_str(); }
};
template <>
struct DataType<swiftlet::RawMessage> {
  static const char* value(const swiftlet::RawMessage& message) { return message.topic->type.c_str(); }
};
template <>
struct Definition<swiftlet::RawMessage> {
  static const char* value(const swiftlet::RawMessage& message) { return message.topic->definition.c_str(); }
};
}  // namespace message_traits
namespace serialization {
template <>
struct Serializer<swiftlet::RawMessage> {
  template <typename Stream>
  static void write(Stream& stream, const swiftlet::RawMessage& message) {
    const auto size = static_cast<std::uint32_t>(message.body.size());
    if (size > 0) std::memcpy(stream.advance(size), message.body.data(), size);
  }
  static std::uint32_t serializedLength(const swiftlet::RawMessage& message) {
    return static_cast<std::uint32_t>(message.body.size());
  }
};
}  // namespace serialization
}  // namespace ros

namespace swiftlet {
namespace {

class Ros1File final : public BagFile {
 public:
  Ros1File(const std::string& path, const std::string& name) : BagFile(name) {
    translated([&] {
      bag_.open(path, rosbag::bagmode::Read);
      view_ = std::make_unique<rosbag::View>(bag_);
      for (const rosbag::MessageInstance& message : *view_) {
        const std::uint32_t topic = topicOf(message.getTopic(), message.getDataType(), BagEncoding::kRos1,
                                            message.getMessageDefinition());
        entries_.push_back(
            {Stamp{static_cast<std::int64_t>(message.getTime().toNSec())}, topic, 0, messages_.size()});
        messages_.push_back(message);
      }
    });
    orderEntries();
  }

  std::span<const std::uint8_t> read(const BagEntry& entry) override {
    translated([&] {
      const rosbag::MessageInstance& message = messages_[entry.at];
      body_.resize(message.size());
      ros::serialization::OStream stream(body_.data(), static_cast<std::uint32_t>(body_.size()));
      message.write(stream);
    });
    return body_;
  }

 private:
  template <typename Call>
  void translated(Call&& call) const {
    try {
      call();
    } catch (const std::exception& error) {
      // Not only rosbag's: damaged lengths and types reach boost, pluginlib and the allocator.
      throw InputError(path_, 0, "", std::string("not a readable bag (") + error.what() + ")",
                       "`rosbag reindex` repairs an interrupted recording");
    }
  }

  rosbag::Bag bag_;
  std::unique_ptr<rosbag::View> view_;
  std::vector<rosbag::MessageInstance> messages_;
  std::vector<std::uint8_t> body_;
};

class Ros1Writer final : public BagWriter {
 public:
  explicit Ros1Writer(const std::string& path) : BagWriter(path) {
    translated([&] { bag_->open(path_, rosbag::bagmode::Write); });
  }
  Ros1Writer(const Ros1Writer&) = delete;
  Ros1Writer& operator=(const Ros1Writer&) = delete;
  ~Ros1Writer() override {
    try {
      bag_->close();
    } catch (const std::exception&) {
      // Never destroyed, because its destructor would close it again and throw; kept, so that it is no leak.
      static auto* const unclosed = new std::vector<rosbag::Bag*>;
      unclosed->push_back(bag_.release());
    }
  }

  [[nodiscard]] BagEncoding encoding() const override { return BagEncoding::kRos1; }

  std::uint32_t addTopic(const BagWriterTopic& topic) override {
    Topic added{topic, nullptr};
    if (topic.latched) {
      // A player needs this to repeat the last message to late subscribers.
      added.fields = boost::make_shared<ros::M_string>();
      (*added.fields)["topic"] = topic.name;
      (*added.fields)["type"] = topic.type;
      (*added.fields)["md5sum"] = topic.md5;
      (*added.fields)["message_definition"] = topic.definition;
      (*added.fields)["latching"] = "1";
    }
    topics_.push_back(added);
    return static_cast<std::uint32_t>(topics_.size() - 1);
  }

  void write(std::uint32_t topic, Stamp log_time, std::uint32_t /*sequence*/,
             std::span<const std::uint8_t> body) override {
    const Topic& to = topics_[topic];
    ros::Time time;
    time.fromNSec(static_cast<std::uint64_t>(log_time.ns));
    translated([&] { bag_->write(to.about.name, time, RawMessage{&to.about, body}, to.fields); });
    ++messages_;
  }

  void finish() override {
    translated([&] {
      bag_->close();
      // rosbag does not report a disk that fills up while closing, so the file is checked.
      rosbag::Bag written(path_, rosbag::bagmode::Read);
      if (rosbag::View(written).size() != messages_) {
        throw rosbag::BagIOException("messages are missing in the written file");
      }
    });
  }

 private:
  struct Topic {
    BagWriterTopic about;
    boost::shared_ptr<ros::M_string> fields;
  };

  template <typename Call>
  void translated(Call&& call) const {
    try {
      call();
    } catch (const std::exception& error) {
      throw InputError(path_, 0, "", std::string("cannot be written (") + error.what() + ")",
                       "Check that the folder exists and is writable and the disk is not full");
    }
  }

  std::unique_ptr<rosbag::Bag> bag_ = std::make_unique<rosbag::Bag>();
  std::vector<Topic> topics_;
  std::uint64_t messages_ = 0;
};

}  // namespace

std::unique_ptr<BagFile> openRos1File(const std::string& path, const std::string& name) {
  return std::make_unique<Ros1File>(path, name);
}

std::unique_ptr<BagWriter> makeRos1Writer(const std::string& path) {
  return std::make_unique<Ros1Writer>(path);
}

bool hasRos1Bags() { return true; }

}  // namespace swiftlet
