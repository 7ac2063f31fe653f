#include "firmware_host/commands/kept_map_options.hpp"

namespace swiftlet {

void addKeptMapOptions(CLI::App& command, KeptMapRequest& request) {
  command.add_option("--keep-map", request.keep,
                     "Keep the map in this new folder for later runs; enables loop closure");
  CLI::Option* in = command.add_option(
      "--in-map", request.in, "Localize in the map of this folder; write poses in its frame to in_map.tum");
  command.add_flag("--extend", request.extend, "Add this run's keyframes to the map of --in-map")->needs(in);
}

}  // namespace swiftlet
