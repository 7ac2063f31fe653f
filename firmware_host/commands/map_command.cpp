#include <fmt/format.h>

#include <memory>

#include "firmware_host/commands/command.hpp"
#include "firmware_host/lab/modules/map_export_run.hpp"
#include "firmware_host/lab/modules/map_merge_run.hpp"
#include "firmware_host/lab/modules/map_slice_run.hpp"

namespace swiftlet {
namespace {

constexpr std::array<const char*, kSliceKinds> kMeanings{
    "unknown (grey)", "surface (black)", "behind a surface (violet)", "no surface within reach (blue)",
    "with a distance (red to yellow)"};

void printSlice(const nlohmann::ordered_json& summary) {
  const auto& x = summary["extent_m"]["x"];
  const auto& y = summary["extent_m"]["y"];
  fmt::print("x {:.2f} to {:.2f} m, y {:.2f} to {:.2f} m, z {:.3f} m; {} x {} pixels of {:g} m\n",
             x[0].get<double>(), x[1].get<double>(), y[0].get<double>(), y[1].get<double>(),
             summary["z_m"].get<double>(), summary["pixels"]["width"].get<int>(),
             summary["pixels"]["height"].get<int>(), summary["pixel_m"].get<double>());
  for (std::size_t i = 0; i < kSliceKinds; ++i) {
    const auto& kind = summary["kinds"][kSliceKindNames[i]];
    fmt::print("  {:<32} {:>9} pixels {:5.1f} %\n", kMeanings[i], kind["pixels"].get<std::size_t>(),
               100 * kind["share"].get<double>());
  }
  fmt::print("largest distance {:.3f} m, reach {:g} m\n", summary["largest_distance_m"].get<double>(),
             summary["reach_m"].get<double>());
}

void addKeptMap(CLI::App& command, std::string& path) {
  command
      .add_option("KEPT_MAP", path, "Folder written by --keep-map, or file written by `swiftlet fuse --keep`")
      ->required();
}

void addSlice(CLI::App& map, int& exit_code) {
  CLI::App* command = map.add_subcommand("slice", "Draw the distance field of a kept map at one height");
  auto request = std::make_shared<MapSliceRequest>();
  addKeptMap(*command, request->map);
  command
      ->add_option("--out", request->out,
                   "Image to write, *.png; the distances in millimetres are written beside it as *_mm.png")
      ->required();
  command->add_option("--z", request->z, "Height in the map's frame [m]. Default: the middle of the map");
  command->add_option("--json", request->json, "File for the figures as JSON");
  command->footer(
      "One pixel is one voxel; x points right, y up. *_mm.png has 16 bits: millimetres to the nearest\n"
      "surface, 0 where no distance is known and on and behind surfaces.\n"
      "Example:\n"
      "  swiftlet fuse data/vil_v102 --keep v102.swm --out map_v102\n"
      "  swiftlet map slice v102.swm --z 1.2 --out slice.png");
  command->callback([request, &exit_code] {
    const MapSliceResult result = runMapSlice(*request);
    printSlice(result.summary);
    fmt::print("written to {} and {}\n", request->out, result.millimetres);
    exit_code = kExitDone;
  });
}

void addExport(CLI::App& map, int& exit_code) {
  CLI::App* command = map.add_subcommand("export", "Export a kept map in the formats of other tools");
  auto request = std::make_shared<MapExportRequest>();
  addKeptMap(*command, request->map);
  command->add_option("--out", request->out, "New folder for the files")->required();
  command->add_option("--z", request->z,
                      "Height of the slices in the map's frame [m]. Default: the middle of the map");
  command->footer(
      "surface.ply, surface.glb   surface for measuring tools and for viewers\n"
      "voxels.ply                 every observed voxel: distance, weight, grey value, label\n"
      "occupancy.png, .yaml       slice for ROS's map_server: free, occupied, unknown\n"
      "distance.png, .yaml        the same slice: distance to the nearest surface, in percent of 40 voxels\n"
      "Example:\n"
      "  swiftlet map export monday --z 1.2 --out monday_files");
  command->callback([request, &exit_code] {
    const nlohmann::ordered_json summary = runMapExport(*request);
    fmt::print("{} faces, {} voxels; slices of {} x {} pixels at {:.3f} m\nwritten to {}\n",
               summary["faces"].get<std::size_t>(), summary["voxels"].get<std::size_t>(),
               summary["pixels"]["width"].get<int>(), summary["pixels"]["height"].get<int>(),
               summary["z_m"].get<double>(), request->out);
    exit_code = kExitDone;
  });
}

void addMerge(CLI::App& map, int& exit_code) {
  CLI::App* command = map.add_subcommand("merge", "Merge two kept maps that show the same places");
  auto request = std::make_shared<MapMergeRequest>();
  command->add_option("FIRST", request->first, "Folder written by --keep-map; the merged map uses its frame")
      ->required();
  command->add_option("SECOND", request->second, "Another kept map, of the same or another vehicle")
      ->required();
  command->add_option("--out", request->out, "New folder for the merged map")->required();
  command->footer("Example:\n  swiftlet map merge monday tuesday --out both");
  command->callback([request, &exit_code] {
    const nlohmann::ordered_json summary = runMapMerge(*request);
    const auto count = [&](const char* which, const char* what) {
      return summary[which][what].get<std::size_t>();
    };
    fmt::print(
        "{} + {} nodes: {} in the merged map, {} loops between the two maps\n"
        "written to {}\n",
        count("first", "nodes"), count("second", "nodes"), count("merged", "nodes"),
        summary["loops_between"].get<std::size_t>(), request->out);
    exit_code = kExitDone;
  });
}

void addInfo(CLI::App& map, int& exit_code) {
  CLI::App* command = map.add_subcommand("info", "Print the contents of a kept map as JSON");
  auto folder = std::make_shared<std::string>();
  command->add_option("KEPT_MAP", *folder, "Folder written by --keep-map")->required();
  command->footer("Example:\n  swiftlet map info monday");
  command->callback([folder, &exit_code] {
    fmt::print("{}\n", mapInfo(*folder).dump(2));
    exit_code = kExitDone;
  });
}

}  // namespace

void addMapCommand(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("map", "Inspect, merge and export kept maps");
  command->require_subcommand(1);
  command->footer("Example:\n  swiftlet map slice v102.swm --out slice.png");
  addExport(*command, exit_code);
  addInfo(*command, exit_code);
  addMerge(*command, exit_code);
  addSlice(*command, exit_code);
}

}  // namespace swiftlet
