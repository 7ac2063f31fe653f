#include "firmware_host/lab/export/bag_output.hpp"

#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/new_folder.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

std::map<std::string, std::uint64_t> fillWith(std::unique_ptr<BagWriter> writer,
                                              const std::function<void(MessageBag&)>& fill) {
  MessageBag bag(std::move(writer));
  fill(bag);
  bag.finish();
  return bag.counts();
}

}  // namespace

std::map<std::string, std::uint64_t> writeBag(BagForm form, const std::string& path,
                                              const std::function<void(MessageBag&)>& fill) {
  if (form == BagForm::kRosbag2) {
    const fs::path folder(path);
    const std::string name = (folder.has_filename() ? folder : folder.parent_path()).filename().string();
    NewFolder made(path, {name + "_0.db3", "metadata.yaml"});
    const std::string part = fs::path(made.file("metadata.yaml")).parent_path().string();
    auto counts = fillWith(makeRosbag2Writer(part, name), fill);
    made.commit();
    return counts;
  }
  const std::string part = path + ".part";
  try {
    auto counts = fillWith(
        form == BagForm::kRos1 ? makeRos1Writer(part) : makeMcapWriter(part, McapPacking::kZstd), fill);
    commitPart(part, path);
    return counts;
  } catch (const InputError& error) {
    std::error_code ignored;
    fs::remove(part, ignored);
    if (error.file != part) throw;
    throw InputError(path, error.line, error.field, error.message, error.remedy);
  }
}

}  // namespace swiftlet
