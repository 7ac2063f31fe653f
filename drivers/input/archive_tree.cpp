#include "drivers/input/archive_tree.hpp"

#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kBlock = 64U << 10U;  // bytes that libarchive reads at a time

bool isPicture(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
  constexpr std::array<std::string_view, 8> kPictures = {".png", ".jpg",  ".jpeg", ".pgm",
                                                         ".bmp", ".tiff", ".tif",  ".exr"};
  return std::ranges::find(kPictures, extension) != kPictures.end();
}

/// Normalized path: "mav0/imu0/data.csv" for "./mav0//imu0/data.csv"; empty if it leads out of the root.
std::string plainPath(const char* given) {
  if (given == nullptr) return {};
  std::string path = std::filesystem::path(given).lexically_normal().string();
  while (path.ends_with('/')) path.pop_back();
  if (path == "." || path.starts_with('/') || path.starts_with("..")) return {};
  return path;
}

std::string folderOf(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? std::string() : path.substr(0, slash);
}

const char* pathOf(archive_entry* entry) {
  const char* path = archive_entry_pathname(entry);
  return path != nullptr ? path : archive_entry_pathname_utf8(entry);
}

/// Reads the current entry of `handle`; false: damaged, or larger than any file of a log.
bool readData(archive* handle, std::vector<std::uint8_t>& bytes) {
  bytes.clear();
  std::array<std::uint8_t, kBlock> block;
  for (;;) {
    const la_ssize_t got = archive_read_data(handle, block.data(), block.size());
    if (got == 0) return true;
    if (got < 0 || bytes.size() + static_cast<std::size_t>(got) > FileTree::kLargestFile) return false;
    bytes.insert(bytes.end(), block.begin(), block.begin() + got);
  }
}

archive* newReader() {
  archive* handle = archive_read_new();
  archive_read_support_filter_all(handle);
  archive_read_support_format_zip(handle);
  archive_read_support_format_tar(handle);
  archive_read_support_format_7zip(handle);
  return handle;
}

}  // namespace

void ArchiveTree::Closer::operator()(archive* handle) const { archive_read_free(handle); }

bool isArchive(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none)) return false;
  archive* handle = newReader();
  archive_entry* entry = nullptr;
  const bool good = archive_read_open_filename(handle, path.c_str(), kBlock) == ARCHIVE_OK &&
                    archive_read_next_header(handle, &entry) >= ARCHIVE_WARN;
  archive_read_free(handle);
  return good;
}

ArchiveTree::ArchiveTree(const std::string& path) : FileTree(path), path_(path) { index(); }

ArchiveTree::Handle ArchiveTree::open() const {
  Handle handle(newReader());
  if (archive_read_open_filename(handle.get(), path_.c_str(), kBlock) < ARCHIVE_WARN) {
    throw InputError(path_, 0, "", std::string("is not an archive: ") + archive_error_string(handle.get()),
                     "");
  }
  return handle;
}

void ArchiveTree::add(const std::string& path, std::size_t number) {
  files_[path] = number;
  // Archives need not list their folders.
  for (std::string child = path; !child.empty();) {
    const std::string folder = folderOf(child);
    const std::size_t name = folder.empty() ? 0 : folder.size() + 1;
    if (!folders_[folder].insert(child.substr(name)).second) break;
    child = folder;
  }
}

void ArchiveTree::index() {
  const Handle handle = open();
  std::size_t text = 0;
  archive_entry* entry = nullptr;
  for (std::size_t number = 0;; ++number) {
    const int result = archive_read_next_header(handle.get(), &entry);
    if (result == ARCHIVE_EOF) break;
    if (result < ARCHIVE_WARN) {
      throw InputError(
          path_, 0, "",
          "is damaged after " + std::to_string(number) + " entries: " + archive_error_string(handle.get()),
          "Download it again, or unpack what is left of it and give the folder");
    }
    const std::string path = plainPath(pathOf(entry));
    if (path.empty() || archive_entry_filetype(entry) != AE_IFREG) continue;
    add(path, number);
    if (isPicture(path)) continue;
    if (archive_entry_size_is_set(entry) != 0 &&
        archive_entry_size(entry) > static_cast<la_int64_t>(kLargestFile))
      continue;
    Bytes bytes;
    if (!readData(handle.get(), bytes)) {
      const char* reason = archive_error_string(handle.get());
      throw InputError(name(path), 0, "",
                       std::string("cannot be unpacked: ") + (reason == nullptr ? "too large" : reason),
                       "Download the archive again; unpack it first if it has a password");
    }
    text += bytes.size();
    if (text > kMostText) {
      throw InputError(path_, 0, "", "holds more than 1 GiB besides its images",
                       "Unpack it and give the folder");
    }
    texts_.emplace(number, std::move(bytes));
  }
}

std::vector<std::string> ArchiveTree::list(const std::string& folder) const {
  const auto found = folders_.find(folder);
  if (found == folders_.end()) return {};
  return {found->second.begin(), found->second.end()};
}

bool ArchiveTree::read(const std::string& path, std::vector<std::uint8_t>& bytes) {
  bytes.clear();
  const auto file = files_.find(path);
  if (file == files_.end()) return false;
  const std::size_t number = file->second;
  if (const auto text = texts_.find(number); text != texts_.end()) {
    bytes = text->second;
    return true;
  }
  if (const auto kept = kept_.find(number); kept != kept_.end()) {
    bytes = std::move(kept->second);
    kept_bytes_ -= bytes.size();
    kept_.erase(kept);
    return true;
  }
  const std::string folder = folderOf(path);
  Reader& reader = readers_[folder];
  if (reader.handle == nullptr || reader.next > number) reader = {open(), 0};
  return readAt(reader, folder, number, bytes);
}

bool ArchiveTree::readAt(Reader& reader, const std::string& folder, std::size_t number, Bytes& bytes) {
  archive* handle = reader.handle.get();
  archive_entry* entry = nullptr;
  for (;;) {
    if (archive_read_next_header(handle, &entry) < ARCHIVE_WARN) {
      reader.handle.reset();
      return false;
    }
    const std::size_t here = reader.next++;
    if (here == number) return readData(handle, bytes);
    if (kept_bytes_ >= kMostKept || texts_.contains(here) || kept_.contains(here)) continue;
    const std::string path = plainPath(pathOf(entry));
    Bytes passed;
    if (folderOf(path) == folder && isPicture(path) && readData(handle, passed))
      keep(here, std::move(passed));
  }
}

void ArchiveTree::keep(std::size_t number, Bytes bytes) {
  kept_bytes_ += bytes.size();
  kept_.emplace(number, std::move(bytes));
}

}  // namespace swiftlet
