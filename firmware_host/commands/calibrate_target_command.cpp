#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "drivers/input/input_error.hpp"
#include "drivers/target/target_file.hpp"
#include "firmware_host/commands/calibrate_commands.hpp"
#include "firmware_host/commands/program.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/lab/calibrate/board/board_pdf.hpp"

namespace swiftlet {
namespace {

struct TargetOptions {
  std::string out;
  std::string kind = "aprilgrid";
  std::string paper = "A4";
  BoardLayout layout;
};

/// A description that someone corrected after measuring the print is not written over.
void refuseOtherBoard(const std::string& file, const std::string& text) {
  std::ifstream in(file, std::ios::binary);
  if (!in || std::string(std::istreambuf_iterator<char>(in), {}) == text) return;
  throw InputError(file, 0, "", "exists and describes another board, or was corrected by hand",
                   "Give another name with --out, or remove this file");
}

int printTarget(TargetOptions options) {
  options.layout.kind = options.kind == "checkerboard" ? TargetKind::kCheckerboard : TargetKind::kAprilGrid;
  const Eigen::Vector2d paper = paperSize(options.paper);
  const CalibrationTarget target = boardForPaper(options.layout, paper);
  const std::string yaml = fileBeside(options.out, ".yaml");
  refuseOtherBoard(yaml, targetYaml(target));
  writeWholeFile(options.out, boardPdf(target, paper));
  writeWholeFile(yaml, targetYaml(target));
  fmt::print(
      "{}: {}\n"
      "{}: board description for --target. Print at 100 %, measure the rulers and the board, and write the "
      "measured size into this file\n",
      options.out, describe(target), yaml);
  if (!target.hasTags() && (target.columns + target.rows) % 2 == 0) {
    fmt::print(
        "This board looks the same after a turn of 180 degrees: keep it upright in all images, or choose one "
        "odd and one even number\n");
  }
  return kExitDone;
}

}  // namespace

void addCalibrateTarget(CLI::App& calibrate, int& exit_code) {
  CLI::App* command =
      calibrate.add_subcommand("target", "Write a calibration board as a printable PDF with its description");
  auto options = std::make_shared<TargetOptions>();
  command->add_option("--out", options->out, "PDF to write; the board's YAML is written beside it")
      ->required();
  command
      ->add_option("--kind", options->kind,
                   "aprilgrid (Kalibr's layout; may be partly outside the image) or checkerboard (must be "
                   "completely visible)")
      ->check(CLI::IsMember({"aprilgrid", "checkerboard"}));
  command->add_option("--paper", options->paper,
                      "A4, A3, A2, A1, A0, letter, tabloid, or width and height in mm, for example 600x400");
  command
      ->add_option("--columns", options->layout.columns,
                   "Tags or inner corners per row. Default: as many as fit the paper")
      ->check(CLI::Range(3, 100));
  command->add_option("--rows", options->layout.rows, "Tags or inner corners per column")
      ->check(CLI::Range(3, 100));
  command->footer(
      "Example:\n"
      "  swiftlet calibrate target --out board.pdf --paper A3\n"
      "Tags and squares are as large as the paper allows. Glue the print to glass or a thick flat plate.");
  command->callback([options, &exit_code] { exit_code = printTarget(*options); });
}

}  // namespace swiftlet
