#include "firmware_host/outputs/map_files/map_report.hpp"

namespace swiftlet {

nlohmann::ordered_json toJson(const MapStage& map) {
  const MapCounters& stage = map.counters();
  const IntegratorCounters& images = map.integrator().counters();
  const VolumeCounters& blocks = map.volume().counters();
  const SurfaceStoreCounters& store = map.surface().counters();
  const DistanceField& distance = map.distance();
  const CorrectionCounters& corrections = map.correction().counters();
  const KeptDepths& kept = map.correction().kept();
  return {{"taken", stage.taken},
          {"without_depth", stage.without_depth},
          {"wrong_size", stage.wrong_size},
          {"epochs", stage.epochs},
          {"refused",
           {{"all", images.refused},
            {"pose_jumps", images.pose_jumps},
            {"bad_poses", images.bad_poses},
            {"bad_stamps", images.bad_stamps}}},
          {"pixels",
           {{"unmeasured", images.pixels.unmeasured},
            {"beyond_range", images.pixels.beyond_range},
            {"uncertain", images.pixels.uncertain},
            {"masked", images.pixels.masked},
            {"bad_label", images.pixels.bad_label}}},
          {"blocks",
           {{"held", map.volume().blockCount()},
            {"capacity", map.volume().blockCapacity()},
            {"free", map.volume().freeCount()},
            {"evicted", blocks.evicted},
            {"evicted_free", blocks.evicted_free},
            {"refused", blocks.refused},
            {"out_of_range", blocks.out_of_range},
            {"index_full", blocks.index_full},
            {"left_out", images.blocks_left_out}}},
          {"corrections",
           {{"begun", corrections.corrections},
            {"images_moved", corrections.images_moved},
            {"images_fused_again", images.again},
            {"blocks_dropped", corrections.blocks_dropped},
            {"images_kept", kept.size()},
            {"capacity", kept.capacity()},
            {"given_up", kept.given_up()}}},
          {"surface",
           {{"patches", map.surface().patches()},
            {"pages", map.surface().pagesUsed()},
            {"capacity", map.surface().pages()},
            {"drawn", map.surfaceStage().counters().drawn},
            {"spilled", store.spilled},
            {"lost", store.lost}}},
          {"bytes",
           {{"volume", map.volume().bytes()},
            {"surface", map.surface().bytes()},
            {"distance", distance.bytes()},
            {"corrections", map.correction().bytes()}}}};
}

}  // namespace swiftlet
