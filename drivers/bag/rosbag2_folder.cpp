#include "drivers/bag/rosbag2_folder.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMetadata = "metadata.yaml";
constexpr int kNewestVersion = 9;

/// `bag_0.db3`, `bag_0.mcap.zstd`, ...
bool isStorage(const fs::path& file) {
  const fs::path name = file.extension() == ".zstd" ? file.stem() : file.filename();
  return name.extension() == ".db3" || name.extension() == ".mcap";
}

/// The number at the end of the stem: rosbag2 numbers the files of a bag.
std::uint64_t numberOf(const std::string& name) {
  const std::string stem = name.substr(0, name.find('.'));
  std::size_t digits = 0;
  while (digits < std::min<std::size_t>(stem.size(), 18) &&
         std::isdigit(static_cast<unsigned char>(stem[stem.size() - 1 - digits])) != 0) {
    ++digits;
  }
  return digits == 0 ? 0 : std::stoull(stem.substr(stem.size() - digits));
}

std::vector<std::string> storageIn(const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_regular_file(error) && isStorage(entry.path()))
      files.push_back(entry.path().filename().string());
  }
  std::sort(files.begin(), files.end(), [](const std::string& a, const std::string& b) {
    return std::pair(numberOf(a), a) < std::pair(numberOf(b), b);
  });
  return files;
}

class Rosbag2Folder final : public BagFile {
 public:
  explicit Rosbag2Folder(const std::string& path) : BagFile(path) {
    const fs::path metadata = fs::path(path) / kMetadata;
    Rosbag2Metadata listed;
    if (fs::exists(metadata)) {
      std::ifstream file(metadata, std::ios::binary);
      const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
      listed = parseRosbag2Metadata(metadata.string(), text);
    } else {
      listed.files = storageIn(path);
      warnings_.push_back(
          fmt::format("{}: no metadata.yaml (its recorder did not finish): its {} files are read", path,
                      listed.files.size()));
    }
    for (const std::string& file : listed.files) add(file);
    if (fs::exists(metadata) && listed.messages != entries_.size()) {
      warnings_.push_back(fmt::format("{}: counts {} messages, but holds {}", metadata.string(),
                                      listed.messages, entries_.size()));
    }
    orderEntries();
  }

  std::span<const std::uint8_t> read(const BagEntry& entry) override {
    BagFile& file = *files_[entry.part];
    return file.read(file.entries()[entry.at]);
  }

 private:
  void add(const std::string& name) {
    fs::path file = fs::path(path_) / name;
    // Older recorders list the file with the folder's name in front.
    if (!fs::exists(file)) file = fs::path(path_) / fs::path(name).filename();
    if (!fs::exists(file)) {
      throw InputError(file.string(), 0, "", "is listed in metadata.yaml but does not exist",
                       "Copy it beside metadata.yaml");
    }
    const auto part = static_cast<std::uint32_t>(files_.size());
    files_.push_back(openBag(file.string()));
    const BagFile& bag = *files_.back();
    warnings_.insert(warnings_.end(), bag.warnings().begin(), bag.warnings().end());
    std::vector<std::uint32_t> topic_of;
    for (const BagTopic& topic : bag.topics()) {
      topic_of.push_back(topicOf(topic.name, topic.type, topic.encoding, topic.definition));
    }
    for (std::size_t i = 0; i < bag.entries().size(); ++i) {
      const BagEntry& entry = bag.entries()[i];
      entries_.push_back({entry.log_time, topic_of[entry.topic], part, i});
    }
  }

  std::vector<std::unique_ptr<BagFile>> files_;
};

}  // namespace

Rosbag2Metadata parseRosbag2Metadata(const std::string& name, std::string_view text) {
  constexpr const char* kRemedy =
      "Rebuild it with `ros2 bag reindex`, or remove it: the folder's files can be read without it";
  Rosbag2Metadata metadata;
  try {
    const YAML::Node root = YAML::Load(std::string(text));
    const YAML::Node bag = root["rosbag2_bagfile_information"];
    if (!bag || !bag.IsMap()) {
      throw InputError(name, 1, "rosbag2_bagfile_information", "is missing",
                       "Check that this is the metadata of a rosbag2");
    }
    const int version = bag["version"].as<int>();
    if (version < 1 || version > kNewestVersion) {
      throw InputError(name, bag["version"].Mark().line + 1, "version",
                       fmt::format("is {}, supported are 1 to {}", version, kNewestVersion),
                       "Convert the bag with `ros2 bag convert`, or give its files one by one");
    }
    metadata.messages = bag["message_count"].as<std::uint64_t>();
    for (const YAML::Node& file : bag["relative_file_paths"])
      metadata.files.push_back(file.as<std::string>());
  } catch (const YAML::Exception& error) {
    throw InputError(name, error.mark.line + 1, "", error.msg, kRemedy);
  }
  if (metadata.files.empty()) throw InputError(name, 0, "relative_file_paths", "lists no files", kRemedy);
  for (const std::string& file : metadata.files) {
    const fs::path path(file);
    const bool outside = path.is_absolute() || std::find(path.begin(), path.end(), "..") != path.end();
    if (outside)
      throw InputError(name, 0, "relative_file_paths", "points outside the folder: " + file, kRemedy);
  }
  return metadata;
}

bool isRosbag2Folder(const std::string& path) {
  return fs::exists(fs::path(path) / kMetadata) || !storageIn(path).empty();
}

std::unique_ptr<BagFile> openRosbag2Folder(const std::string& path) {
  return std::make_unique<Rosbag2Folder>(path);
}

}  // namespace swiftlet
