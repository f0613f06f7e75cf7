#include "engine/cluster_lights.h"

#include <algorithm>

namespace shoal {
namespace {

constexpr int kAxisBits = 10, kKeyBits = 3 * kAxisBits;
constexpr int kDigitBits = 10;
static_assert(kKeyBits % kDigitBits == 0);

struct KeyedLight {
  uint32_t key;
  uint32_t index;
};

/// Two zero bits after each of the low ten.
uint32_t spread_bits(uint32_t x) {
  x = (x | x << 16) & 0x030000ffu;
  x = (x | x << 8) & 0x0300f00fu;
  x = (x | x << 4) & 0x030c30c3u;
  return (x | x << 2) & 0x09249249u;
}

double doubled_middle(const TreeLight& light, int axis) { return double{light.lo[axis]} + light.hi[axis]; }

/// Places on the curve, its cells cubes; empty if all lights are in one place.
std::vector<KeyedLight> keys_of(std::span<const TreeLight> lights) {
  double lo[3], hi[3], longest = 0;
  for (int a = 0; a < 3; ++a) lo[a] = hi[a] = doubled_middle(lights[0], a);
  for (const TreeLight& light : lights) {
    for (int a = 0; a < 3; ++a) {
      const double at = doubled_middle(light, a);
      lo[a] = at < lo[a] ? at : lo[a], hi[a] = at > hi[a] ? at : hi[a];
    }
  }
  for (int a = 0; a < 3; ++a) longest = std::max(longest, hi[a] - lo[a]);
  if (!(longest > 0)) return {};
  constexpr double kSteps = 1 << kAxisBits;
  const double scale = kSteps / longest;
  std::vector<KeyedLight> keys(lights.size());
  for (size_t i = 0; i < lights.size(); ++i) {
    uint32_t key = 0;
    for (int a = 0; a < 3; ++a) {
      const double at = std::min((doubled_middle(lights[i], a) - lo[a]) * scale, kSteps - 1);
      key |= spread_bits(static_cast<uint32_t>(at)) << a;
    }
    keys[i] = {key, static_cast<uint32_t>(i)};
  }
  return keys;
}

/// By key, then by index.
void sort_keys(std::vector<KeyedLight>& keys) {
  if (keys.size() < 256) {
    std::sort(keys.begin(), keys.end(), [](const KeyedLight& a, const KeyedLight& b) {
      return a.key != b.key ? a.key < b.key : a.index < b.index;
    });
    return;
  }
  std::vector<KeyedLight> other(keys.size());
  for (int shift = 0; shift < kKeyBits; shift += kDigitBits) {
    constexpr uint32_t kDigits = 1u << kDigitBits;
    uint32_t place[kDigits] = {};
    for (const KeyedLight& k : keys) ++place[k.key >> shift & (kDigits - 1)];
    uint32_t sum = 0;
    for (uint32_t& p : place) {
      const uint32_t count = p;
      p = sum, sum += count;
    }
    for (const KeyedLight& k : keys) other[place[k.key >> shift & (kDigits - 1)]++] = k;
    keys.swap(other);
  }
}

/// lights[i] becomes what was lights[keys[i].index]. A copy is quicker than going round cycles in place, where each step
/// waits for the one before.
void arrange(std::span<TreeLight> lights, const std::vector<KeyedLight>& keys) {
  std::vector<TreeLight> sorted;
  sorted.reserve(lights.size());
  for (const KeyedLight& k : keys) sorted.push_back(lights[k.index]);
  std::copy(sorted.begin(), sorted.end(), lights.begin());
}

class Cutter {
 public:
  Cutter(std::span<const TreeLight> lights, const std::vector<KeyedLight>& keys, uint32_t most,
         std::vector<LightCluster>& clusters)
      : lights_(lights), keys_(keys), most_(most), clusters_(clusters) {}

  /// [first, last) have the same bits above `bit`.
  void cut(uint32_t first, uint32_t last, int bit) {
    if (last - first <= most_ || bit < 0) {
      LightCluster cluster{LightSums(lights_[first]), first, last - first};
      for (uint32_t i = first + 1; i < last; ++i) cluster.sums.add(LightSums(lights_[i]));
      if (!clusters_.empty() && clusters_.back().count + cluster.count <= most_) {
        clusters_.back().sums.add(cluster.sums), clusters_.back().count += cluster.count;
      } else {
        clusters_.push_back(cluster);
      }
      return;
    }
    const auto middle = std::partition_point(keys_.begin() + first, keys_.begin() + last,
                                             [bit](const KeyedLight& k) { return (k.key >> bit & 1) == 0; });
    const uint32_t at = static_cast<uint32_t>(middle - keys_.begin());
    if (at > first) cut(first, at, bit - 1);
    if (at < last) cut(at, last, bit - 1);
  }

 private:
  std::span<const TreeLight> lights_;
  const std::vector<KeyedLight>& keys_;
  uint32_t most_;
  std::vector<LightCluster>& clusters_;
};

}  // namespace

std::vector<LightCluster> cluster_lights(std::span<TreeLight> lights, uint32_t most) {
  std::vector<KeyedLight> keys = keys_of(lights);
  std::vector<LightCluster> clusters;
  const int top = keys.empty() ? -1 : kKeyBits - 1;
  if (top >= 0) {
    sort_keys(keys);
    arrange(lights, keys);
  }
  Cutter(lights, keys, most, clusters).cut(0, static_cast<uint32_t>(lights.size()), top);
  return clusters;
}

uint64_t clustering_bytes(uint64_t lights) {
  // Two clusters have more lights than one may have; a vector that grows is up to twice as large, and half of that is
  // copied. Before, lights are copied.
  const uint64_t clusters = std::min(lights, 2 * lights / cluster_size(lights) + 1);
  return lights * sizeof(KeyedLight) + std::max(3 * clusters * sizeof(LightCluster), lights * sizeof(TreeLight));
}

}  // namespace shoal
