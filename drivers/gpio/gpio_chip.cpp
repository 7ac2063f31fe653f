#include "drivers/gpio/gpio_chip.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <vector>

namespace swiftlet {
namespace {

/// Text of a field that ends with 0 or at its full size.
template <std::size_t kSize>
std::string fieldText(const char (&field)[kSize]) {
  return {field, strnlen(field, kSize)};
}

std::vector<std::string> chipPaths() {
  constexpr const char* kPrefix = "gpiochip";
  std::vector<std::string> paths;
  DIR* folder = opendir("/dev");
  if (folder == nullptr) return paths;
  while (const dirent* entry = readdir(folder)) {
    if (std::strncmp(entry->d_name, kPrefix, std::strlen(kPrefix)) == 0) {
      paths.push_back(std::string("/dev/") + entry->d_name);
    }
  }
  closedir(folder);
  // Sort by number: shorter names first.
  std::sort(paths.begin(), paths.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return paths;
}

}  // namespace

void GpioChip::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

DeviceFault GpioChip::openPath(const std::string& path) {
  close();
  fd_ = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (fd_ < 0) return openFault(errno, path);
  gpiochip_info info{};
  if (ioctl(fd_, GPIO_GET_CHIPINFO_IOCTL, &info) != 0) {
    const int error = errno;
    close();
    if (error == ENODEV) return deviceFault(DeviceFaultKind::kUnplugged, error, "%s", path.c_str());
    return deviceFault(DeviceFaultKind::kWrongDevice, error, "%s is not a GPIO chip", path.c_str());
  }
  path_ = path;
  name_ = fieldText(info.name);
  label_ = fieldText(info.label);
  lines_ = info.lines;
  return {};
}

DeviceFault GpioChip::open(const std::string& which) {
  if (!which.empty() && which.front() == '/') return openPath(which);
  DeviceFault refused;
  std::string offers;
  for (const std::string& path : chipPaths()) {
    const DeviceFault fault = openPath(path);
    if (fault.kind == DeviceFaultKind::kNoRights) refused = fault;
    if (!fault.ok()) continue;
    if (name_ == which || label_ == which) return {};
    offers += (offers.empty() ? "" : ", ") + name_ + " (" + label_ + ")";
  }
  close();
  // The wanted chip may be among those that this user may not open.
  if (!refused.ok()) return refused;
  return deviceFault(DeviceFaultKind::kMissing, 0, "no GPIO chip is named '%s'; available: %s", which.c_str(),
                     offers.empty() ? "none" : offers.c_str());
}

DeviceFault GpioChip::line(std::uint32_t offset, GpioLine& out) const {
  // Version 1 of this call: available in all supported kernels.
  gpioline_info info{};
  info.line_offset = offset;
  if (ioctl(fd_, GPIO_GET_LINEINFO_IOCTL, &info) != 0) {
    const DeviceFaultKind kind = errno == ENODEV ? DeviceFaultKind::kUnplugged : DeviceFaultKind::kFailed;
    return deviceFault(kind, errno, "requesting line %u", offset);
  }
  out = {offset, fieldText(info.name), fieldText(info.consumer), (info.flags & GPIOLINE_FLAG_KERNEL) != 0,
         (info.flags & GPIOLINE_FLAG_IS_OUT) != 0};
  return {};
}

DeviceFault GpioChip::findLine(const std::string& which, GpioLine& out) const {
  std::uint32_t offset = 0;
  const char* end = which.data() + which.size();
  const auto [rest, error] = std::from_chars(which.data(), end, offset);
  if (!which.empty() && error == std::errc() && rest == end) {
    if (offset < lines_) return line(offset, out);
    return deviceFault(DeviceFaultKind::kMissing, 0, "line %u; %s has lines 0 to %d", offset, name_.c_str(),
                       static_cast<int>(lines_) - 1);
  }
  for (std::uint32_t i = 0; i < lines_; ++i) {
    const DeviceFault fault = line(i, out);
    if (!fault.ok()) return fault;
    if (!which.empty() && out.name == which) return {};
  }
  return deviceFault(DeviceFaultKind::kMissing, 0, "%s has no line named '%s'", name_.c_str(), which.c_str());
}

}  // namespace swiftlet
