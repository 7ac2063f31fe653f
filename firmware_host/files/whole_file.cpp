#include "firmware_host/files/whole_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void failToWrite(const std::string& path, int error) {
  throw InputError(path, 0, "", std::string("cannot be written: ") + std::strerror(error),
                   "Check that the folder exists and is writable and the disk is not full");
}

/// Target of a link; the path itself if it is no link, or if the link leads nowhere.
std::string followed(const std::string& path) {
  std::error_code error;
  const fs::path target = fs::canonical(path, error);
  return error ? path : target.string();
}

/// Errors are ignored: some file systems cannot sync folders, and the file already has its name.
void syncFolderOf(const std::string& path) {
  const fs::path parent = fs::path(path).parent_path();
  const int folder = ::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return;
  (void)::fsync(folder);
  ::close(folder);
}

}  // namespace

WholeFile::WholeFile(const std::string& path, Sync sync) : path_(path), target_(followed(path)), sync_(sync) {
  std::error_code error;
  const fs::file_status status = fs::status(target_, error);
  // Refused here, because renaming over a folder would fail only at the end.
  if (fs::is_directory(status)) failToWrite(path_, EISDIR);
  if (!fs::exists(status) || fs::is_regular_file(status)) part_ = target_ + ".part";
  file_.reset(std::fopen((part_.empty() ? target_ : part_).c_str(), "wbe"));
  if (!file_) fail(errno);
}

WholeFile::~WholeFile() {
  file_.reset();
  if (!part_.empty()) ::unlink(part_.c_str());
}

void WholeFile::fail(int error) {
  file_.reset();
  if (!part_.empty()) ::unlink(part_.c_str());
  part_.clear();
  failToWrite(path_, error);
}

void WholeFile::write(std::string_view bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail(errno);
}

void WholeFile::commit() {
  if (std::fflush(file_.get()) != 0) fail(errno);
  const bool sync = sync_ == Sync::kYes && !part_.empty();
  if (sync && ::fsync(::fileno(file_.get())) != 0) fail(errno);
  // Some file systems (NFS) report a full disk only here.
  if (std::fclose(file_.release()) != 0) fail(errno);
  if (part_.empty()) return;
  if (::rename(part_.c_str(), target_.c_str()) != 0) fail(errno);
  part_.clear();
  if (sync) syncFolderOf(target_);
}

void writeWholeFile(const std::string& path, std::string_view bytes, WholeFile::Sync sync) {
  WholeFile file(path, sync);
  file.write(bytes);
  file.commit();
}

void commitPart(const std::string& part, const std::string& path) {
  const int file = ::open(part.c_str(), O_RDONLY | O_CLOEXEC);
  int error = file < 0 || ::fsync(file) != 0 ? errno : 0;
  if (file >= 0) ::close(file);
  if (error == 0 && ::rename(part.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(part.c_str());
    failToWrite(path, error);
  }
  syncFolderOf(path);
}

}  // namespace swiftlet
