extends Node

func _ready():
	run()

func tell(name, value):
	JavaScriptBridge.eval("window.told[%s] = %s; undefined" % [JSON.stringify(name), JSON.stringify(value)])

func run():
	var image = Image.new()
	image.load_png_from_buffer(FileAccess.get_file_as_bytes("res://walk.png"))
	var document = GLTFDocument.new()
	var state = GLTFState.new()
	document.append_from_buffer(FileAccess.get_file_as_bytes("res://walk.glb"), "", state)
	var model = document.generate_scene(state)
	var found = model.find_children("*", "MeshInstance3D", true, false)
	var arrays = found[0].mesh.surface_get_arrays(0)
	arrays[Mesh.ARRAY_INDEX] = null
	var mesh = ArrayMesh.new()
	mesh.add_surface_from_arrays(Mesh.PRIMITIVE_POINTS, arrays)
	mesh.custom_aabb = AABB(Vector3(-1000, -1000, -1000), Vector3(2000, 2000, 2000))
	var n = arrays[Mesh.ARRAY_VERTEX].size()
	tell("version", Engine.get_version_info().string)
	tell("format", [image.get_format(), found[0].mesh.surface_get_format(0), image.get_size().x, image.get_size().y])
	tell("rest", Marshalls.raw_to_base64(arrays[Mesh.ARRAY_VERTEX].to_byte_array()))
	tell("places", Marshalls.raw_to_base64(arrays[Mesh.ARRAY_TEX_UV2].to_byte_array()))
	var columns = 64
	var rows = (n + columns - 1) / columns
	var shader = Shader.new()
	shader.code = FileAccess.get_file_as_string("res://reading.gdshader")
	var material = ShaderMaterial.new()
	material.shader = shader
	material.set_shader_parameter("pca_texture", ImageTexture.create_from_image(image))
	material.set_shader_parameter("fps", 0.0)
	material.set_shader_parameter("size", Vector2(columns, rows))
	var instance = MeshInstance3D.new()
	instance.mesh = mesh
	instance.material_override = material
	var viewport = SubViewport.new()
	viewport.size = Vector2i(columns, rows)
	viewport.own_world_3d = true
	viewport.render_target_update_mode = SubViewport.UPDATE_ALWAYS
	viewport.add_child(instance)
	var camera = Camera3D.new()
	camera.projection = Camera3D.PROJECTION_ORTHOGONAL
	camera.position = Vector3(0, 0, 10)
	viewport.add_child(camera)
	add_child(viewport)
	var frames = JSON.parse_string(FileAccess.get_file_as_string("res://frames.json"))
	for frame in frames:
		for what in [0, 1]:
			var bits = PackedByteArray()
			for bit in 32:
				material.set_shader_parameter("start_frame", frame)
				material.set_shader_parameter("what", what)
				material.set_shader_parameter("bit", bit)
				await RenderingServer.frame_post_draw
				await RenderingServer.frame_post_draw
				var seen = viewport.get_texture().get_image()
				seen.convert(Image.FORMAT_RGB8)
				bits.append_array(seen.get_data())
			tell("%s %s" % [frame, what], Marshalls.raw_to_base64(bits))
	tell("done", true)
