#include "firmware_host/inputs/devices/connected_devices.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

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

/// Whether this user may open a node for reading and writing, with what to do where not.
MachineLine node(const std::string& what, const fs::path& path, std::string found) {
  if (access(path.c_str(), R_OK | W_OK) == 0) return {what, std::move(found), MachineVerdict::kGood, ""};
  const std::string group = what == "serial port" ? "dialout" : "gpio";
  return {what, found + ": this user may not open it", MachineVerdict::kPoor,
          fmt::format("`sudo usermod -aG {} $USER`, then log in again; `ls -l {}` says whose it is", group,
                      path.string())};
}

void addCameras(MachineReport& report) {
  bool any = false;
  for (const CameraListing& camera : listCameras()) {
    // Decoders and the second nodes of USB cameras, which give metadata, are no cameras.
    if (camera.fault.kind == DeviceFaultKind::kWrongDevice) continue;
    any = true;
    if (!camera.fault.ok()) {
      report.lines.push_back({"camera", describe(camera.fault, camera.path), MachineVerdict::kPoor,
                              camera.fault.kind == DeviceFaultKind::kNoRights
                                  ? "`sudo usermod -aG video $USER`, then log in again"
                                  : ""});
      continue;
    }
    // Those that are not taken only where there is no other: they may be dozens.
    const bool taken = std::ranges::any_of(camera.formats, &FormatOffer::taken);
    std::string offers;
    std::size_t others = 0;
    for (const FormatOffer& format : camera.formats) {
      if (taken && !format.taken) {
        ++others;
        continue;
      }
      offers +=
          fmt::format("{}{} {}", offers.empty() ? "" : "; ", format.fourcc, fmt::join(format.sizes, " "));
    }
    if (others > 0) offers += fmt::format("; {} other formats", others);
    report.lines.push_back(
        {"camera",
         fmt::format("{} {} ({}, {}): {}", camera.path, camera.card, camera.driver, camera.bus, offers),
         taken ? MachineVerdict::kGood : MachineVerdict::kPoor,
         taken ? "" : "it offers no format that is taken; docs/v4l2.md lists them"});
  }
  if (any) return;
  report.lines.push_back(
      {"camera", "none", MachineVerdict::kNote,
       "connect one; a CSI camera also needs its overlay in the boot settings, and `dmesg` "
       "says whether its sensor answered"});
}

void addSerialPorts(const fs::path& root, MachineReport& report) {
  constexpr std::array<const char*, 6> kPrefixes = {"ttyUSB", "ttyACM", "ttyAMA",
                                                    "ttyTHS", "ttymxc", "ttySAC"};
  std::vector<std::pair<fs::path, fs::path>> names;  // a name that stays, and what it leads to
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
                          "connect the IMU, or switch the board's UART on in its boot settings"});
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
      {"CAN interface", "none", MachineVerdict::kNote, "wanted only where the IMU is on a CAN bus"});
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
      {"GPIO chip", "none", MachineVerdict::kNote, "wanted only where a line sees the cameras' trigger"});
}

}  // namespace

MachineReport connectedDevices(const std::string& root) {
  const fs::path base = root.empty() ? fs::path("/") : fs::path(root);
  MachineReport report;
  addCameras(report);
  addSerialPorts(base, report);
  addCanInterfaces(base, report);
  addGpioChips(base, report);
  return report;
}

}  // namespace swiftlet
