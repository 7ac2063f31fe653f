#include "firmware_host/commands/kept_map_options.hpp"

namespace swiftlet {

void addKeptMapOptions(CLI::App& command, KeptMapRequest& request) {
  command.add_option("--keep-map", request.keep,
                     "New folder for what a later run needs to fly in this one's map (closes loops)");
  CLI::Option* in =
      command.add_option("--in-map", request.in,
                         "Folder that --keep-map wrote, to be located in: poses in its frame in in_map.tum");
  command.add_flag("--extend", request.extend, "Make what this run sees a part of the map of --in-map")
      ->needs(in);
}

}  // namespace swiftlet
