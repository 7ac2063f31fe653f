#include "firmware_host/lab/calibrate/page/image_drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "firmware_host/outputs/page/page.hpp"

namespace swiftlet {
namespace {

constexpr double kCells = 200;
constexpr std::size_t kMostDots = 12'000;  // for a drawing of 150 kB

/// From white over yellow to dark red.
std::string heatColour(double share) {
  constexpr std::array<std::array<double, 3>, 4> kRamp = {
      {{247, 250, 252}, {252, 217, 118}, {227, 92, 51}, {102, 0, 38}}};
  const double at = std::clamp(share, 0.0, 1.0) * (kRamp.size() - 1);
  const std::size_t low = std::min(static_cast<std::size_t>(at), kRamp.size() - 2);
  const double part = at - static_cast<double>(low);
  const auto mix = [&](std::size_t i) {
    return static_cast<int>(std::lround(kRamp[low][i] + part * (kRamp[low + 1][i] - kRamp[low][i])));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2));
}

}  // namespace

ImageGrid::ImageGrid(int width, int height)
    : size_(std::sqrt(width * height / kCells)),
      columns_(static_cast<int>(std::ceil(width / size_))),
      rows_(static_cast<int>(std::ceil(height / size_))) {
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector2d centre(std::min((column + 0.5) * size_, width - 1.0),
                                   std::min((row + 0.5) * size_, height - 1.0));
      cells_.push_back({centre, cells_.size()});
    }
  }
}

std::size_t ImageGrid::indexOf(const Eigen::Vector2d& pixel) const {
  const int column = std::clamp(static_cast<int>(pixel.x() / size_), 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(pixel.y() / size_), 0, rows_ - 1);
  return static_cast<std::size_t>(row * columns_ + column);
}

ImageDrawing::ImageDrawing(int width, int height)
    : width_(width), height_(height), line_(std::max(width, height) / 500.0) {}

void ImageDrawing::dots(const std::vector<Eigen::Vector2d>& pixels, const char* colour) {
  std::string path;
  const std::size_t step = pixels.size() / kMostDots + 1;
  for (std::size_t i = 0; i < pixels.size(); i += step) {
    path += fmt::format("M{:.0f} {:.0f}h0", pixels[i].x(), pixels[i].y());
  }
  over_ += fmt::format(R"(<path d="{}" stroke="{}" stroke-width="{:.2f}" stroke-linecap="round"/>)", path,
                       colour, 2.2 * line_);
}

void ImageDrawing::arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& along, const char* colour) {
  const Eigen::Vector2d to = from + along;
  const Eigen::Vector2d back = -0.3 * along;
  const Eigen::Vector2d side(-0.5 * back.y(), 0.5 * back.x());
  const Eigen::Vector2d a = to + back + side;
  const Eigen::Vector2d b = to + back - side;
  over_ += fmt::format(
      R"(<path d="M{:.1f} {:.1f}L{:.1f} {:.1f}M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}" stroke="{}" stroke-width="{:.2f}" fill="none"/>)",
      from.x(), from.y(), to.x(), to.y(), a.x(), a.y(), to.x(), to.y(), b.x(), b.y(), colour, 1.2 * line_);
}

void ImageDrawing::heat(const ImageGrid& grid, const std::vector<double>& values, double most,
                        const std::string& unit) {
  const double half = grid.size() / 2;
  for (const ImageCell& cell : grid.cells()) {
    const double value = values[cell.index];
    if (!std::isfinite(value)) continue;
    const double x = std::floor(cell.centre.x() / grid.size()) * grid.size();
    const double y = std::floor(cell.centre.y() / grid.size()) * grid.size();
    under_ += fmt::format(
        R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="{}"><title>{:.3g} {}</title></rect>)",
        x, y, std::min(2 * half + 0.3, width_ - x), std::min(2 * half + 0.3, height_ - y),
        heatColour(value / most), value, htmlText(unit));
  }
  constexpr int kSteps = 5;
  const double letter = 7 * line_;
  const double top = height_ + below_ + letter;
  for (int i = 0; i <= kSteps; ++i) {
    const double share = static_cast<double>(i) / kSteps;
    const double x = share * 0.8 * width_;
    over_ += fmt::format(
        R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="{}" stroke="#bbb" stroke-width="{:.2f}"/>)",
        x, top, 2 * letter, letter, heatColour(share), 0.3 * line_);
    over_ += fmt::format(R"(<text x="{:.1f}" y="{:.1f}" style="font-size:{:.1f}px">{:.2g}{}</text>)",
                         x + 2.4 * letter, top + letter, 1.6 * letter, share * most,
                         i == kSteps ? " " + htmlText(unit) + " or more" : "");
  }
  below_ += 3 * letter;
}

void ImageDrawing::caption(const std::string& text) {
  const double letter = 11 * line_;
  below_ += 1.5 * letter;
  over_ += fmt::format(R"(<text x="0" y="{:.1f}" style="font-size:{:.1f}px">{}</text>)", height_ + below_,
                       letter, htmlText(text));
}

std::string ImageDrawing::svg() const {
  return fmt::format(
      R"(<svg viewBox="-2 -2 {} {:.0f}" font-family="system-ui,sans-serif">{}<rect width="{}" height="{}" fill="none" stroke="#5d6870" stroke-width="{:.2f}"/>{}</svg>)",
      width_ + 4, height_ + below_ + 8, under_, width_, height_, line_, over_);
}

std::string logDrawing(const std::vector<LogCurve>& curves, const std::string& x_label,
                       const std::string& y_label) {
  constexpr double kWidth = 640;
  constexpr double kHeight = 360;
  constexpr double kLeft = 70;
  constexpr double kBottom = 40;
  constexpr double kRight = 110;
  Eigen::Vector2d low(1e300, 1e300);
  Eigen::Vector2d high(-1e300, -1e300);
  for (const LogCurve& curve : curves) {
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      if (!(curve.x[i] > 0) || !(curve.y[i] > 0)) continue;
      const Eigen::Vector2d at(std::log10(curve.x[i]), std::log10(curve.y[i]));
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
  }
  if (low.x() > high.x()) return "<svg viewBox=\"0 0 10 10\"></svg>";
  low = low.array().floor();
  high = high.array().ceil().max(low.array() + 1);
  const auto x = [&](double value) {
    return kLeft + (std::log10(value) - low.x()) / (high.x() - low.x()) * (kWidth - kLeft - kRight);
  };
  const auto y = [&](double value) {
    return (high.y() - std::log10(value)) / (high.y() - low.y()) * (kHeight - kBottom) + 4;
  };
  std::string svg = fmt::format(
      R"(<svg viewBox="0 0 {} {}" font-family="system-ui,sans-serif" font-size="11">)", kWidth, kHeight + 10);
  for (double power = low.x(); power <= high.x() + 0.5; ++power) {
    const double at = x(std::pow(10, power));
    svg += fmt::format(
        R"(<path d="M{:.1f} 4V{}" stroke="#ddd"/><text x="{:.1f}" y="{}" text-anchor="middle">1e{:.0f}</text>)",
        at, kHeight - kBottom + 4, at, kHeight - kBottom + 18, power);
  }
  for (double power = low.y(); power <= high.y() + 0.5; ++power) {
    const double at = y(std::pow(10, power));
    svg += fmt::format(
        R"(<path d="M{} {:.1f}H{}" stroke="#ddd"/><text x="{}" y="{:.1f}" text-anchor="end">1e{:.0f}</text>)",
        kLeft, at, kWidth - kRight, kLeft - 5, at + 4, power);
  }
  double legend = 16;
  for (const LogCurve& curve : curves) {
    std::string path;
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      if (!(curve.x[i] > 0) || !(curve.y[i] > 0)) continue;
      const char* how = curve.points || path.empty() ? "M" : "L";
      path += fmt::format("{}{:.1f} {:.1f}{}", how, x(curve.x[i]), y(curve.y[i]), curve.points ? "h0" : "");
    }
    svg += fmt::format(R"(<path d="{}" fill="none" stroke="{}" stroke-width="{}" stroke-linecap="round"/>)",
                       path, curve.colour, curve.points ? 5 : 1.4);
    if (curve.name.empty()) continue;
    svg += fmt::format(R"(<text x="{}" y="{}" fill="{}">{}</text>)", kWidth - kRight + 8, legend,
                       curve.colour, htmlText(curve.name));
    legend += 15;
  }
  return svg +
         fmt::format(R"(<text x="{}" y="{}" text-anchor="end">{}</text><text x="{}" y="{}">{}</text></svg>)",
                     kWidth - kRight, kHeight + 2, htmlText(x_label), kWidth - kRight + 8, kHeight - kBottom,
                     htmlText(y_label));
}

std::string scatterDrawing(const std::vector<Eigen::Vector2d>& points, double sigma,
                           const std::string& unit) {
  constexpr double kHalf = 240;
  constexpr double kShown = 5;  // sigmas from the middle to the edge
  const double scale = kHalf / (kShown * std::max(sigma, 1e-9));
  std::string path;
  const std::size_t step = points.size() / kMostDots + 1;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector2d at = (points[i] * scale).cwiseMax(-kHalf).cwiseMin(kHalf);
    path += fmt::format("M{:.0f} {:.0f}h0", at.x(), at.y());
  }
  std::string svg = fmt::format(
      R"(<svg viewBox="-245 -245 490 515" font-family="system-ui,sans-serif" font-size="14"><path d="{}" stroke="#1f6fb4" stroke-opacity="0.4" stroke-width="3" stroke-linecap="round"/><path d="M-240 0H240M0 -240V240" stroke="#bbb"/>)",
      path);
  for (const double sigmas : {1.0, 3.0}) {
    svg += fmt::format(R"(<circle r="{:.1f}" fill="none" stroke="#b03a3a"/>)", sigmas * sigma * scale);
  }
  return svg +
         fmt::format(R"(<text x="-240" y="264">circles: 1 and 3 sigma, 1 sigma = {:.3g} {}</text></svg>)",
                     sigma, htmlText(unit));
}

}  // namespace swiftlet
