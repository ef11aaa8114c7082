// Instances of a scene's shape groups: what they repeat, and where.
#pragma once

#include "drjit_traits.h"
#include "strands.h"

#include <mitsuba/core/transform.h>
#include <mitsuba/render/scene.h>
#include <mitsuba/render/shapegroup.h>

#include <string_view>
#include <vector>

NAMESPACE_BEGIN(mitsuba)

// A shape's `to_world`.
template <typename Float, typename Spectrum> class ReadPlace final : public TraversalCallback {
  public:
    MI_IMPORT_TYPES()
    ScalarAffineTransform4f to_world;

  protected:
    void put_value(std::string_view name, void *value, uint32_t, const std::type_info &) override {
        if (name == "to_world") to_world = dr::slice<ScalarAffineTransform4f>(*static_cast<AffineTransform4f *>(value));
    }
    void put_object(std::string_view, Object *, uint32_t) override {}
};

// The shapes that a scene's shape stands for, and where: itself, or its group's if it is an instance.
template <typename Float, typename Spectrum> struct Placed {
    MI_IMPORT_TYPES(Scene, Shape, ShapeGroup)
    std::vector<ref<Shape>> parts;
    ScalarAffineTransform4f to_world;

    Placed(const Scene *scene, const ref<Shape> &shape) : parts{shape} {
        if (!shape->is_instance()) return;
        ReadPlace<Float, Spectrum> place;
        const_cast<Shape *>(shape.get())->traverse(&place);
        to_world = place.to_world;
        parts = group_of(scene, shape.get())->shapes();
    }

  private:
    // Mitsuba does not tell: it is the group that has as much in it and fills the instance's box. Of several, any will do if
    // their hair looks alike.
    const ShapeGroup *group_of(const Scene *scene, const Shape *shape) const {
        const ShapeGroup *found = nullptr;
        for (const auto &group : scene->shapegroups()) {
            if (!fills(group.get(), shape)) continue;
            if (found && looks(found) != looks(group.get()))
                Throw(
                    "dual_scattering: instances cannot be told apart whose shapegroups have as many segments, the same "
                    "bounds and other BSDFs: leave a strand out of one of them");
            found = group.get();
        }
        if (!found)
            Throw(
                "dual_scattering: an instance that moves while the shutter is open is not supported: leave its animation "
                "out");
        return found;
    }
    bool fills(const ShapeGroup *group, const Shape *shape) const {
        const ScalarBoundingBox3f box = shape->bbox();
        if (group->primitive_count() != shape->effective_primitive_count()) return false;
        if (!group->bbox().valid() && !box.valid()) return true;
        ScalarBoundingBox3f moved;
        for (int k = 0; k < 8; ++k) moved.expand(to_world * group->bbox().corner(k));
        const ScalarFloat off = dr::max(dr::maximum(dr::abs(moved.min - box.min), dr::abs(moved.max - box.max)));
        return off <= ScalarFloat(1e-4) * dr::norm(box.extents());
    }
    // The BSDF of each shape that is hair.
    static std::vector<const Object *> looks(const ShapeGroup *group) {
        std::vector<const Object *> found;
        for (const auto &shape : group->shapes()) {
            const auto *bsdf = shape->bsdf();
            if (bsdf && bsdf->flags() & cuticle_mitsuba::hair_flag) found.push_back(bsdf);
        }
        return found;
    }
};

NAMESPACE_END(mitsuba)
