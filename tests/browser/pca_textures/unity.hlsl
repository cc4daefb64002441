// What Unity gives a Custom Function node, but for its struct of a texture, which has no equal in WebGL.
Texture2D<float4> Bound : register(t0);
cbuffer Frames : register(b0) { float Number; };
#include "MeshreelPcaUnity.hlsl"
struct Seen
{
    float4 at : SV_Position;
    float3 position : TEXCOORD0;
    float3 normal : TEXCOORD1;
};
Seen main(float3 position : POSITION, float3 normal : NORMAL, float2 uv : TEXCOORD0)
{
    Seen seen;
    MeshreelPca_float(Bound, uv, Number, position, normal, seen.position, seen.normal);
    seen.at = float4(0.0, 0.0, 0.0, 1.0);
    return seen;
}
