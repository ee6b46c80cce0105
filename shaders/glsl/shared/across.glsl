// Floats from one workgroup to another of the same dispatch, in words of a buffer. They are atomic because `coherent` is not honoured
// everywhere; a barrier and an atomic counter order them (`is_last`).
#extension GL_KHR_memory_scope_semantics : require

#define put(word, value) \
    atomicStore(word, floatBitsToUint(value), gl_ScopeDevice, gl_StorageSemanticsNone, gl_SemanticsRelaxed)
#define got(word) uintBitsToFloat(atomicLoad(word, gl_ScopeDevice, gl_StorageSemanticsNone, gl_SemanticsRelaxed))
