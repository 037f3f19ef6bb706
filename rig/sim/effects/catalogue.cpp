#include <algorithm>
#include <array>
#include <cassert>

#include "rig/sim/effects/effect.h"

namespace plumbline::sim {

const std::vector<const EffectInfo*>& effect_catalogue() {
  static const std::vector<const EffectInfo*> all = [] {
    std::vector<const EffectInfo*> list;
    for (const auto family : {sensor_effects(), electronics_effects(), head_effects(),
                              room_effects(), own_sensor_effects(), own_electronics_effects(),
                              own_head_effects(), own_room_effects()}) {
      for (const EffectInfo& info : family) list.push_back(&info);
    }
    return list;
  }();
  return all;
}

const EffectInfo* find_effect(std::string_view id) {
  const auto& all = effect_catalogue();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](auto* info) { return info->id == id; });
  return found == all.end() ? nullptr : *found;
}

std::vector<std::unique_ptr<Effect>> make_effects(const World& world, const Triad& triad,
                                                  std::uint64_t seed) {
  std::vector<std::unique_ptr<Effect>> effects;
  for (const EffectSetting& setting : world.effects) {
    const EffectInfo* info = find_effect(setting.id);
    assert(info != nullptr && "effects are checked when the world is read");
    effects.push_back(info->make({setting, world, triad, seed}));
  }
  return effects;
}

}  // namespace plumbline::sim
