// Plays PCA textures of meshreel in Unity: the code of a Custom Function node of a Shader Graph. Needs
// meshreel_pca.hlsl in the same folder. UV1 is the second UV set of the mesh, as glTFast imports it; Frame is
// counted from 0.
#ifndef MESHREEL_PCA_UNITY
#define MESHREEL_PCA_UNITY

float3 MeshreelPcaAdded(Texture2D<float4> Tex, float2 Place, float Frame, float Section)
{
#include "meshreel_pca.hlsl"
}

void MeshreelPca_float(UnityTexture2D Tex, float2 UV1, float Frame, float3 Position, float3 Normal,
                       out float3 MovedPosition, out float3 MovedNormal)
{
    // glTF importers for Unity mirror x and flip v.
    float2 place = float2(UV1.x, 1.0 - UV1.y);
    float3 mirror = float3(-1.0, 1.0, 1.0);
    MovedPosition = Position + mirror * MeshreelPcaAdded(Tex.tex, place, Frame, 0.0);
    MovedNormal = normalize(Normal + mirror * MeshreelPcaAdded(Tex.tex, place, Frame, 1.0));
}

#endif
