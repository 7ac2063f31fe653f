#include "firmware_host/inputs/devices/connected_devices.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "drivers/image/grey_reader.hpp"
#include "drivers/v4l2/camera_device.hpp"
#include "drivers/v4l2/camera_offers.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    found.push_back(entry.path());
  }
  std::ranges::sort(found);
  return found;
}

std::string firstLine(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// Reports whether this user may open a device node for reading and writing, with the remedy if not.
MachineLine node(const std::string& what, const fs::path& path, std::string found) {
  if (access(path.c_str(), R_OK | W_OK) == 0) return {what, std::move(found), MachineVerdict::kGood, ""};
  const std::string group = what == "serial port" ? "dialout" : "gpio";
  return {what, found + ": no permission to open it", MachineVerdict::kPoor,
          fmt::format("`sudo usermod -aG {} $USER`, then log in again; `ls -l {}` shows the owner", group,
                      path.string())};
}

/// Tries whether a camera delivers images in this format at its current size.
DeviceFault tryFormat(const std::string& path, const std::string& fourcc) {
  constexpr int kPatience = 1000;  // ms; the slowest cameras deliver five images a second
  constexpr int kMostBroken = 3;   // the first image after a start is often broken
  CameraDeviceSettings settings;
  settings.setPath(path.c_str());
  settings.setFormat(fourcc.c_str());
  settings.require_monotonic = false;
  CameraDevice camera(settings);
  if (const DeviceFault fault = camera.open(); !fault.ok()) return fault;
  GreyReader reader;
  reader.reserve(camera.facts().format, camera.facts().width, camera.facts().height, false);
  for (int i = 0; i < kMostBroken; ++i) {
    pollfd waiting{camera.fd(), POLLIN, 0};
    if (poll(&waiting, 1, kPatience) == 0) {
      return deviceFault(DeviceFaultKind::kSilent, 0,
                         "no image within a second; a camera with an external trigger waits for it");
    }
    CapturedFrame frame;
    if (const DeviceFault fault = camera.next(frame); !fault.ok()) return fault;
    if (frame.valid() && !reader.read(frame.image).empty()) return {};
  }
  return deviceFault(DeviceFaultKind::kGarbage, 0, "its images are damaged");
}

/// "YUYV, MJPG 640x480 1280x720; GREY 640x480": formats with the same sizes are grouped.
std::string inGroups(const std::vector<const FormatOffer*>& formats) {
  std::string text;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    text += fmt::format("{}{}",
                        text.empty()                                          ? ""
                        : i > 0 && formats[i]->sizes == formats[i - 1]->sizes ? ", "
                                                                              : "; ",
                        formats[i]->fourcc);
    const bool last = i + 1 == formats.size() || formats[i + 1]->sizes != formats[i]->sizes;
    if (last) text += fmt::format(" {}", fmt::join(formats[i]->sizes, " "));
  }
  return text;
}

void addCamera(const CameraListing& camera, bool try_formats, MachineReport& report) {
  std::vector<const FormatOffer*> working;
  std::vector<std::string> others;
  DeviceFault first;
  for (const FormatOffer& format : camera.formats) {
    if (!format.taken) {
      others.push_back(format.fourcc);
      continue;
    }
    // A camera that delivers no image at all is not tried in every format.
    DeviceFault fault;
    if (first.kind == DeviceFaultKind::kSilent || first.kind == DeviceFaultKind::kBusy) {
      fault = first;
    } else if (try_formats) {
      fault = tryFormat(camera.path, format.fourcc);
    }
    if (fault.ok()) {
      working.push_back(&format);
    } else {
      others.push_back(format.fourcc);
      if (first.ok()) first = fault;
    }
  }
  const std::string name = fmt::format("{} {} ({}, {})", camera.path, camera.card, camera.driver, camera.bus);
  std::string found = working.empty() ? "no usable format" : inGroups(working);
  if (!others.empty()) found += fmt::format("; not: {}", fmt::join(others, " "));
  std::string remedy;
  if (working.empty()) {
    remedy =
        first.ok() ? "it offers no supported format; docs/v4l2.md lists them" : describe(first, camera.path);
  }
  report.lines.push_back({"camera", fmt::format("{}: {}", name, found),
                          working.empty() ? MachineVerdict::kPoor : MachineVerdict::kGood, remedy});
}

void addCameras(bool try_formats, MachineReport& report) {
  bool any = false;
  for (const CameraListing& camera : listCameras()) {
    // Decoders and the metadata nodes of USB cameras are not cameras.
    if (camera.fault.kind == DeviceFaultKind::kWrongDevice) continue;
    any = true;
    if (camera.fault.ok()) {
      addCamera(camera, try_formats, report);
    } else {
      report.lines.push_back({"camera", describe(camera.fault, camera.path), MachineVerdict::kPoor,
                              camera.fault.kind == DeviceFaultKind::kNoRights
                                  ? "`sudo usermod -aG video $USER`, then log in again"
                                  : ""});
    }
  }
  if (any) return;
  report.lines.push_back({"camera", "none", MachineVerdict::kNote,
                          "connect a camera; a CSI camera also needs its overlay in the boot settings, and "
                          "`dmesg` shows whether its sensor responded"});
}

void addSerialPorts(const fs::path& root, MachineReport& report) {
  constexpr std::array<const char*, 6> kPrefixes = {"ttyUSB", "ttyACM", "ttyAMA",
                                                    "ttyTHS", "ttymxc", "ttySAC"};
  std::vector<std::pair<fs::path, fs::path>> names;  // device path, and the persistent name that links to it
  for (const fs::path& name : entries(root / "dev/serial/by-id")) {
    std::error_code error;
    names.emplace_back(fs::weakly_canonical(name, error), name);
  }
  bool any = false;
  for (const fs::path& path : entries(root / "dev")) {
    const std::string file = path.filename().string();
    if (std::ranges::none_of(kPrefixes, [&](const char* prefix) { return file.starts_with(prefix); }))
      continue;
    any = true;
    const auto stays = std::ranges::find(names, path, &std::pair<fs::path, fs::path>::first);
    report.lines.push_back(
        node("serial port", path,
             stays == names.end() ? path.string() : fmt::format("{} ({})", stays->second.string(), file)));
  }
  if (any) return;
  report.lines.push_back({"serial port", "none", MachineVerdict::kNote,
                          "connect the IMU, or enable the board's UART in its boot settings"});
}

void addCanInterfaces(const fs::path& root, MachineReport& report) {
  constexpr const char* kCan = "280";  // ARPHRD_CAN
  bool any = false;
  for (const fs::path& interface : entries(root / "sys/class/net")) {
    if (firstLine(interface / "type") != kCan) continue;
    any = true;
    const std::string name = interface.filename().string();
    const std::string flags = firstLine(interface / "flags");
    constexpr int kHexadecimal = 16;
    const bool up = (std::strtoul(flags.c_str(), nullptr, kHexadecimal) & 1U) != 0;  // IFF_UP
    report.lines.push_back(
        {"CAN interface", fmt::format("{}: {}", name, up ? "up" : "down"),
         up ? MachineVerdict::kGood : MachineVerdict::kPoor,
         up ? ""
            : fmt::format("`sudo ip link set {} up{}`", name,
                          name.starts_with("vcan") ? "" : " type can bitrate 1000000 restart-ms 100")});
  }
  if (any) return;
  report.lines.push_back(
      {"CAN interface", "none", MachineVerdict::kNote, "only needed for an IMU on a CAN bus"});
}

void addGpioChips(const fs::path& root, MachineReport& report) {
  bool any = false;
  for (const fs::path& path : entries(root / "dev")) {
    if (!path.filename().string().starts_with("gpiochip")) continue;
    any = true;
    report.lines.push_back(node("GPIO chip", path, path.string()));
  }
  if (any) return;
  report.lines.push_back(
      {"GPIO chip", "none", MachineVerdict::kNote, "only needed for a line with the cameras' trigger"});
}

}  // namespace

MachineReport connectedDevices(const std::string& root, bool try_formats) {
  const fs::path base = root.empty() ? fs::path("/") : fs::path(root);
  MachineReport report;
  addCameras(try_formats, report);
  addSerialPorts(base, report);
  addCanInterfaces(base, report);
  addGpioChips(base, report);
  return report;
}

}  // namespace swiftlet
