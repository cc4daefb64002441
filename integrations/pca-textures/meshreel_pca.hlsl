// Offset of the rest position of a vertex (Section 0) or of its normal (Section 1) from PCA textures of
// meshreel, in glTF axes. This is the body of a function, or of a Custom node in Unreal, with the inputs
//   Texture2D Tex, float2 Place (column and row of the vertex), float Frame (from 0), float Section
#define PCA_BYTES(place) uint4(Tex.Load(int3(place, 0)) * 255.0 + 0.5)
#define PCA_TEXEL(index) PCA_BYTES(int2((index) % width, (index) / width))
#define PCA_NUMBER(bytes) (bytes.r | bytes.g << 8 | bytes.b << 16)
#define PCA_WEIGHT(bytes) asfloat(bytes.r << 24 | bytes.g << 16 | bytes.b << 8 | bytes.a)
#define PCA_ONE(index) PCA_WEIGHT(PCA_TEXEL(index))
#define PCA_WEIGHTS(index) float4(PCA_ONE(index), PCA_ONE(index + 1), PCA_ONE(index + 2), PCA_ONE(index + 3))

uint width, height;
Tex.GetDimensions(width, height);
uint header[8];
for (uint entry = 0; entry < 8; entry++)
{
    uint4 own = PCA_TEXEL(entry);
    header[entry] = PCA_NUMBER(own);
}
bool isNormal = Section > 0.5;
uint nFrames = header[0], sliceRows = header[1];
uint nPositions = 4 * header[3] + 8 * header[4], nNormals = 4 * header[6] + 8 * header[7];
uint nPairs = isNormal ? header[6] : header[3], nSingles = isNormal ? header[7] : header[4];
int2 place = int2(Place + 0.5);
place.y += int(isNormal ? header[5] : header[2]);
uint first = 8 + (isNormal ? nPositions : 0), stride = nPositions + nNormals;
uint before = first + stride * (uint(Frame) % nFrames);
uint after = first + stride * ((uint(Frame) + 1) % nFrames);
float3 added = float3(0.0, 0.0, 0.0);
for (uint texel = 0; texel < nPairs + nSingles; texel++)
{
    float4 lowerWeights = lerp(PCA_WEIGHTS(before), PCA_WEIGHTS(after), frac(Frame));
    float4 upperWeights = 15.0 * lowerWeights;
    before += 4;
    after += 4;
    if (texel >= nPairs)
    {
        upperWeights = lowerWeights;
        lowerWeights = lerp(PCA_WEIGHTS(before), PCA_WEIGHTS(after), frac(Frame));
        before += 4;
        after += 4;
    }
    for (uint axis = 0; axis < 3; axis++)
    {
        uint4 own = PCA_BYTES(place);
        float4 upper = float4(own >> 4) - 8.0, lower = float4(own & 15) - 8.0;
        float3 along = float3(axis == 0, axis == 1, axis == 2);
        added += along * (dot(upper, upperWeights) + dot(lower, lowerWeights));
        place.y += int(sliceRows);
    }
}
return added;
